"""Saves a view: the command line that renders it, and picture files with that command inside."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np

from ..options import Settings
from ..pictures.exposure import exposure_text
from ..pictures.image import save_image
from ..scene.files.camera_files import camera_fields
from ..scene.files.light_texts import light_texts
from ..settings import apply_quality, describe
from .session import DISPLAY, Session


def command_of(session: Session, output: str = "view.png") -> str:
    """Return the command line that renders the view, with its exposure as a number."""
    # Scene, size, camera, changed lights, buffer, time.
    size, camera = "{}x{}".format(*session.size), json.dumps(_camera_fields(session))
    words = ["wgpu-gi", "render", *session.source, "-o", output, "--size", size, "--camera", camera]
    for text in light_texts(session.renderer.scene):
        if text not in session.start_lights:
            words += ["--relight", text]
    if session.shown != DISPLAY:
        words += ["--show", session.shown]
    if session.renderer.time is not None:
        words += ["--at", repr(float(session.renderer.time)), f"--animation={session.playback.name}"]

    # Technique, exposure, and each setting that differs from its preset.
    settings = session.settings
    words += ["--gi", settings.gi, "--quality", session.quality, "--exposure", repr(session.exposure)]
    plain = Settings(gi=settings.gi, exposure=settings.exposure)
    apply_quality(plain, session.quality)
    for row, usual in zip(describe(settings), describe(plain), strict=True):
        if row.value != usual.value:
            value = "none" if row.value is None else row.value
            words += ["--set", f"{row.name}={value!r}" if isinstance(value, float) else f"{row.name}={value}"]
    return shlex.join(words)


def save(session: Session, folder: Path | None = None) -> list[Path]:
    """Write the buffer shown as .png and linear .exr, at full size, with camera and command; return the files."""
    session.render_full_size()
    folder = folder or Path.cwd()
    stem, number = Path(session.source[0]).stem, 1
    while (folder / f"{stem}-{number:03d}.png").exists():
        number += 1
    name = "radiance" if session.shown == DISPLAY else session.shown
    layers = {name: session.values()}
    files = [folder / f"{stem}-{number:03d}{suffix}" for suffix in (".png", ".exr")]
    for file in files:
        metadata = {"command": command_of(session, file.name), "camera": json.dumps(_camera_fields(session))}
        if session.certificate is not None:
            metadata |= session.certificate.texts()
        if file.suffix == ".png":
            metadata["exposure"] = exposure_text(session.exposure, session.settings.exposure is None)
        save_image(file, layers, exposure=session.exposure, metadata=metadata)
    return files


def _camera_fields(session: Session) -> dict[str, object]:
    distance = float(np.linalg.norm(session.pivot - session.camera.position))
    return camera_fields(session.camera, max(distance, 1e-9))
