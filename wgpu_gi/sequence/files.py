"""The files of a sequence of frames: pictures, their layers, and a .json with the command and the cameras."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..errors import GiError
from ..pictures.atomic_file import atomic_file
from ..pictures.image import check_output, save_image

_NUMBER = re.compile(r"\{frame(?::(0?\d{0,2})d?)?\}")

Pictures = dict[str, NDArray]


class FrameFiles:
    """The files of a sequence: a picture for each frame, its layers beside it, and one .json for all frames."""

    def __init__(self, output: str, shown: Sequence[str], layers: Sequence[str], transparent: bool = False) -> None:
        """Raises GiError for invalid file names; touches no file."""
        self.output, self.shown, self.layers, self.transparent = output, list(shown), list(layers), transparent
        self.job_file = Path(_NUMBER.sub("job", output)).with_suffix(".json")
        if len(_NUMBER.findall(Path(output).name)) != 1 or _NUMBER.search(str(Path(output).parent)):
            raise GiError(f"-o {output}: the file name must contain {{frame}} once, such as f_{{frame:04d}}.exr")
        if layers and Path(output).suffix.lower() == ".npz":
            raise GiError(f"-o {output}: --layers writes .npz files of the same name; use --show here instead")

    def make_folder(self) -> None:
        """Make the folder. Raises GiError if the files could not be written later."""
        try:
            Path(self.output).parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise GiError(f"-o {self.output}: its folder cannot be made ({error.strerror or error})") from None
        check_output(self._name(0), self.shown, self.transparent)

    def _name(self, frame: int) -> Path:
        return Path(_NUMBER.sub(lambda match: format(frame, f"{match[1] or ''}d"), self.output))

    def moved_to(self, folder: str | Path) -> FrameFiles:
        """Return the same files in another folder."""
        return FrameFiles(str(Path(folder) / Path(self.output).name), self.shown, self.layers, self.transparent)

    def paths(self, frame: int) -> list[Path]:
        """Return the files of a frame, in the order in which they are written."""
        name = self._name(frame)
        return [*([name.with_suffix(".npz")] if self.layers else []), name]

    def exist(self, frame: int) -> bool:
        """Tell whether all files of a frame exist."""
        return all(path.exists() for path in self.paths(frame))

    def add(self, frame: int, pictures: Pictures, exposure: float | None, metadata: dict[str, object]) -> None:
        """Write the files of a frame."""
        name = self._name(frame)
        if self.layers:
            save_image(name.with_suffix(".npz"), {layer: pictures[layer] for layer in self.layers})
        shown = {layer: pictures[layer] for layer in self.shown}
        save_image(name, shown, exposure=exposure, metadata={**metadata, "frame": frame})

    def claim(self, command: dict[str, object], cameras: dict[int, dict[str, object]]) -> None:
        """Write the .json. Raises GiError if the existing one is from another command."""
        # Convert to what a JSON reader returns: lists for tuples, and text for keys.
        now = json.loads(json.dumps({"command": command, "cameras": cameras}))
        before = self._read()
        if before is None:
            self._write(now)
            return
        old, new = (job["command"] | {"cameras": job["cameras"]} for job in (before, now))
        differing = sorted(name for name in old | new if old.get(name) != new.get(name))
        if differing:
            raise GiError(
                f"{self.job_file}: the frames there were made by another command ({', '.join(differing)} differ);"
                " give -o another name, or delete the frames with that file"
            )

    def has_exposure(self) -> bool:
        """Tell whether the .json has the exposure of the sequence."""
        return "exposure" in (self._read() or {})

    def exposure(self, measure: Callable[[], float | None]) -> float | None:
        """Return the exposure of the sequence from the .json; if it has none, measure it and write it there."""
        if not self.has_exposure():
            measured = measure()
            # Another command may have measured it meanwhile, on another adapter: all frames get the first that is kept.
            job = self._read() or {}
            if "exposure" in job:
                measured = job["exposure"]
            else:
                self._write({**job, "exposure": measured})
            return measured
        exposure: float | None = (self._read() or {})["exposure"]
        return exposure

    def _read(self) -> dict[str, Any] | None:
        """Return what the .json holds, None if there is none."""
        try:
            job: dict[str, Any] = json.loads(self.job_file.read_text(encoding="utf-8"))
            return {**job, "command": dict(job["command"]), "cameras": dict(job["cameras"])}
        except FileNotFoundError:
            return None
        except (OSError, ValueError, TypeError, KeyError):
            message = f"{self.job_file}: not a record of frames; move it away, or give -o another name"
            raise GiError(message) from None

    def _write(self, job: dict[str, Any]) -> None:
        with atomic_file(self.job_file) as temporary:
            temporary.write_text(json.dumps(job, indent=1), encoding="utf-8")
