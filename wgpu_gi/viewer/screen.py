"""The screen: copies of one or two pictures, so that the window can redraw them during the next frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import wgpu
from numpy.typing import NDArray

from ..gpu.device import Device
from ..gpu.wgsl.load import load

SHADER = "viewer/screen.wgsl"
LINE_PIXELS = 1.0  # half the width of the line between two pictures


class Screen:
    """Draws into a render pass whose target has `format`."""

    def __init__(self, device: Device, format: str) -> None:
        self._gpu = device.gpu
        source = load(SHADER)
        self._params = np.zeros((), source.struct_dtype("Screen"))
        usage = wgpu.BufferUsage.UNIFORM | wgpu.BufferUsage.COPY_DST
        self._buffer = self._gpu.create_buffer(label="screen", size=self._params.nbytes, usage=usage)
        self._sampler = self._gpu.create_sampler(label="screen", mag_filter="linear", min_filter="linear")
        module = self._gpu.create_shader_module(label=SHADER, code=source.text)
        self._pipeline = self._gpu.create_render_pipeline(
            label="screen",
            layout="auto",
            vertex={"module": module, "entry_point": "corner"},
            fragment={"module": module, "entry_point": "pixel", "targets": [{"format": format}]},
            primitive={"topology": "triangle-list"},
        )
        self._textures: list[Any] = [self._texture((1, 1)), self._texture((1, 1))]
        self._group: Any = None

    def copy(self, which: int, texture: Any) -> None:
        """Copy an rgba8unorm texture as picture `which`, 0 or 1."""
        width, height, _ = texture.size
        target = self._fitting(which, (width, height))
        encoder = self._gpu.create_command_encoder(label="screen")
        encoder.copy_texture_to_texture({"texture": texture}, {"texture": target}, (width, height, 1))
        self._gpu.queue.submit([encoder.finish()])

    def write(self, which: int, pixels: NDArray[np.float32]) -> None:
        """Upload sRGB-coded values in [0, 1], (height, width, 3), as picture `which`."""
        height, width, _ = pixels.shape
        coded = np.full((height, width, 4), 255, np.uint8)
        coded[..., :3] = np.round(pixels * 255.0)
        target = self._fitting(which, (width, height))
        layout = {"bytes_per_row": width * 4, "rows_per_image": height}
        self._gpu.queue.write_texture({"texture": target}, coded, layout, (width, height, 1))

    def draw(self, render_pass: Any, split: float, width: int, panel: tuple[float, float, float, float]) -> None:
        """Draw the first picture, and the second one right of `split` (a share of the `width` in pixels).

        `panel` is the darkened rectangle behind the panel: left, top, right, bottom, shares of width and height.
        """
        self._params["panel"], self._params["split"], self._params["line"] = panel, split, LINE_PIXELS / width
        self._gpu.queue.write_buffer(self._buffer, 0, self._params.tobytes())
        if self._group is None:
            resources = [texture.create_view() for texture in self._textures]
            resources += [self._sampler, {"buffer": self._buffer, "offset": 0, "size": self._buffer.size}]
            entries = [{"binding": i, "resource": resource} for i, resource in enumerate(resources)]
            layout = self._pipeline.get_bind_group_layout(0)
            self._group = self._gpu.create_bind_group(label="screen", layout=layout, entries=entries)
        render_pass.set_pipeline(self._pipeline)
        render_pass.set_bind_group(0, self._group)
        render_pass.draw(3)

    def _fitting(self, which: int, size: tuple[int, int]) -> Any:
        """Return the texture of a picture, recreated if its size differs."""
        if self._textures[which].size[:2] != size:
            self._textures[which].destroy()
            self._textures[which], self._group = self._texture(size), None
        return self._textures[which]

    def _texture(self, size: tuple[int, int]) -> Any:
        usage = wgpu.TextureUsage.TEXTURE_BINDING | wgpu.TextureUsage.COPY_DST
        return self._gpu.create_texture(label="screen", size=(*size, 1), format="rgba8unorm", usage=usage)
