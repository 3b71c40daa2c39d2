"""The textures of MTL libraries: finds, decodes and places the pictures that `map_` rows name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import GiError
from ...float_limits import LARGEST_FACTOR
from ..scene import Image, Texture
from .memory import MemoryBudget
from .notes import Notes
from .read import find_inside, path_inside, read_file

# The most words that each option of a `map_` row takes. Those of numbers may take fewer.
_NUMBERS = {"-s": 3, "-o": 3, "-t": 3, "-mm": 2, "-bm": 1, "-boost": 1, "-texres": 1}
_WORDS = {"-blendu": 1, "-blendv": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-type": 1}


class Textures:
    """The textures in the files below `folder`, each decoded once; `notes` receives what cannot be shown."""

    def __init__(self, folder: Path, notes: Notes, budget: MemoryBudget) -> None:
        self.notes = notes
        self._folder = folder
        self._budget = budget
        self._known: dict[tuple[Path | str, bool], Image | None] = {}

    def of_row(self, row: str | None, folder: Path | None = None, deep: bool = False) -> Texture | None:
        """Return the texture that a `map_` row names after its options; None, with a note, if it cannot be loaded.

        The file is looked for in `folder`, that of the library, and in that of the scene. `deep` keeps 16 bits.
        """
        if not row:
            return None
        options, name = split_options(row)
        image = self._image(name, folder or self._folder, deep)
        if image is None:
            return None
        texture = Texture(image)
        if options.get("-clamp", ["off"])[0].lower() == "on":
            texture.wrap_u = texture.wrap_v = "clamp"
        # OBJ's (u, v), with v upwards, becomes s (u, v) + o.
        scale, offset = self._pair(options, "-s", 1.0, row), self._pair(options, "-o", 0.0, row)
        texture.scale = scale
        texture.offset = offset[0], 1.0 - scale[1] - offset[1]
        unused = [key for key in ("-mm", "-t", "-imfchan") if key in options]
        if unused:
            self.notes.add(f"texture {name!r}: the options {' '.join(unused)} are not used")
        return texture

    def with_mask(self, color: Texture | None, row: str, folder: Path | None = None) -> Texture | None:
        """Return `color`, white if it is None, with the opacity of a `map_d` row; None if that cannot be loaded.

        Opacity is the picture's alpha if it has any, else its luminance (its mean).
        """
        mask = self.of_row(row, folder)
        if mask is None:
            return None
        pixels = mask.image.eight_bit
        opaque = bool((pixels[..., 3] == 255).all())
        alpha = pixels[..., :3].mean(-1).astype(np.uint8) if opaque else pixels[..., 3]
        if color is None:
            color = mask
            base = np.full((*alpha.shape, 3), 255, np.uint8)
        else:
            base = color.image.eight_bit[..., :3]
            alpha = _resampled(alpha, base.shape[0], base.shape[1])
        self._budget.take(4 * alpha.size, f"texture {mask.image.name} as a mask")
        image = Image(np.dstack([base, alpha]), f"{color.image.name} cut out")
        return Texture(image, color.wrap_u, color.wrap_v, offset=color.offset, scale=color.scale)

    def _pair(self, options: dict[str, list[str]], key: str, default: float, row: str) -> tuple[float, float]:
        """Return the first two numbers of an option."""
        numbers = [float(word) for word in options.get(key, ())][:2]
        if not all(abs(number) <= LARGEST_FACTOR for number in numbers):
            self.notes.damage(f"texture row {row[:80]!r}: {key} is out of range; it was ignored")
            numbers = []
        u, v = (*numbers, *([default] * (2 - len(numbers))))
        return u, v

    def _image(self, name: str, folder: Path, deep: bool) -> Image | None:
        """Return a picture; None, with a note, if it cannot be loaded."""
        places = dict.fromkeys((folder, self._folder))
        file = next((file for place in places if (file := find_inside(self._folder, name, place))), None)
        if file is None:
            # Exporters write paths of their own machines: take a file of that name beside the library.
            last = name.replace("\\", "/").rpartition("/")[2]
            file = next((file for place in places if last and (file := find_inside(self._folder, last, place))), None)
        key = file or name, deep
        if key not in self._known:
            self._known[key] = self._load(name, file or path_inside(self._folder, name), deep)
        return self._known[key]

    def _load(self, name: str, file: Path | None, deep: bool) -> Image | None:
        """Return the picture in a file, or None with a note why it cannot be shown."""
        # These import Pillow, which few scenes here need.
        from .image_files import decode_image, open_image, without_warnings

        if file is None:
            self.notes.damage(f"texture {name[:80]!r} lies outside the scene's folder; the plain colour is used")
            return None
        try:
            encoded = read_file(file, "texture")
        except GiError as error:
            self.notes.damage(f"{error}; the plain colour is used")
            return None
        with without_warnings():
            picture = open_image(encoded, self._budget, f"texture {file}", deep)
            pixels = decode_image(picture, srgb=not deep)
        if isinstance(pixels, str) or isinstance(picture, str):
            self.notes.damage(f"texture {file} cannot be used: {pixels}; the plain colour is used")
            return None
        if picture.note:
            self.notes.add(f"texture {file}: {picture.note}")
        return Image(pixels, name)


def split_options(row: str) -> tuple[dict[str, list[str]], str]:
    """Split a `map_` row into its options, each with its words, and the file name, which may have spaces."""
    options: dict[str, list[str]] = {}
    words = row.split()
    while len(words) > 1 and (words[0].lower() in _NUMBERS or words[0].lower() in _WORDS):
        option = words.pop(0).lower()
        most = _NUMBERS.get(option) or _WORDS[option]
        taken: list[str] = []
        while len(taken) < most and len(words) > 1 and (option in _WORDS or _is_number(words[0])):
            taken.append(words.pop(0))
        options[option] = taken or ["off"] if option in _WORDS else taken
    return options, " ".join(words).strip('"')


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _resampled(plane: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """Return a plane of another size, by its nearest pixels."""
    rows = np.arange(height) * plane.shape[0] // height
    columns = np.arange(width) * plane.shape[1] // width
    return plane[rows[:, None], columns]
