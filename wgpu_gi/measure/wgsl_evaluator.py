"""Evaluates functions of the WGSL libraries on arrays: one invocation per row, results as numpy arrays."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import wgpu
from numpy.typing import ArrayLike, NDArray

from ..camera import Camera
from ..gpu.device import open_device
from ..gpu.graph import Graph
from ..gpu.handles import Handle
from ..gpu.wgsl.load import load, refresh
from ..scene.scene import Scene
from ..techniques.shared.scene_inputs import share_scene
from ..upload.scene_upload import SceneUpload

WIDTHS = {"f32": 1, "u32": 1, "vec2f": 2, "vec3f": 3, "vec4f": 4}
SHADER = """\
#import "{library}"
@group(1) @binding(20) var<storage, read> input: array<u32>;
@group(1) @binding(21) var<storage, read_write> result: array<u32>;
{accessors}
{functions}
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {{
  let i = id.x;
  if (i >= {n}u) {{ return; }}
  let value: {returns} = {expression};
{stores}
}}
"""


class Evaluator:
    """Calls WGSL: `evaluate("common/math.wgsl", "luminance(color(i))", "f32", color=array)`.

    `folder` takes the shader that calls the function.
    """

    def __init__(self, folder: Path, adapter: str | None = None) -> None:
        self.device = open_device(adapter, large_buffers=True)
        self.folder = folder

    def __call__(
        self,
        library: str,
        expression: str,
        returns: str,
        *,
        count: int | None = None,
        functions: str = "",
        scene: Scene | None = None,
        **arrays: ArrayLike,
    ) -> NDArray:
        """Return `expression` for every index i, (n,) or (n, components).

        `arrays` are float32 or uint32 of n rows, of one to four components if float; in WGSL they are functions of i.
        `functions` is WGSL code for the expression. With `scene` the scene's buffers and uniforms are bound.
        """
        # Write the shader. One buffer holds all arrays: the scene needs most of the eight that WebGPU guarantees.
        values = {name: np.asarray(array) for name, array in arrays.items()}
        n = count or max(map(len, values.values()))
        accessors, words = _packed(values)
        width = WIDTHS[returns]
        parts = ["value"] if width == 1 else [f"value.{'xyzw'[k]}" for k in range(width)]
        stores = "\n".join(f"  result[{width}u * i + {k}u] = bitcast<u32>({part});" for k, part in enumerate(parts))
        text = SHADER.format(
            library=library,
            accessors=accessors,
            functions=functions,
            n=n,
            returns=returns,
            expression=expression,
            stores=stores,
        )
        (self.folder / "evaluate.wgsl").write_text(text, encoding="utf-8")
        refresh()

        # Declare one pass, and run it.
        buffer = self.device.gpu.create_buffer_with_data(data=words, usage=wgpu.BufferUsage.STORAGE)
        graph, upload = Graph(self.device, shader_root=self.folder), SceneUpload(self.device)
        try:
            graph.begin()
            reads: dict[str, Handle] = {"input": graph.share("input", buffer)} if values else {}
            constants: dict[str, bool] = {}
            if scene is not None:
                handles, constants = self._share(graph, upload, scene)
                reads |= handles
            output = graph.buffer("result", dtype=np.uint32, count=n * width)
            written: dict[str, Handle] = {"result": output}
            graph.compute("evaluate", "evaluate.wgsl", over=n, reads=reads, writes=written, constants=constants)
            graph.compile([output])
            graph.run()
            result: NDArray = graph.read_back(output)
        finally:
            graph.release()
            upload.release()
            buffer.destroy()
        if returns != "u32":
            result = result.view(np.float32)
        return result if width == 1 else result.reshape(n, width)

    def _share(self, graph: Graph, upload: SceneUpload, scene: Scene) -> tuple[dict[str, Handle], dict[str, bool]]:
        """Upload the scene; return the resources that the shader reads, and its constants."""
        source = load("evaluate.wgsl", self.folder)
        upload.update(scene)
        graph.uniform("view", upload.view(Camera(), (1, 1), False))
        inputs = share_scene(graph, upload)
        used = source.entry_points["main"].uses
        handles: dict[str, Handle] = {k: h for k, h in {**inputs.surfaces, **inputs.lights}.items() if k in used}
        return handles, {k: v for k, v in inputs.features.items() if k in source.overrides}


def _packed(values: Mapping[str, NDArray]) -> tuple[str, NDArray[np.uint32]]:
    """Return WGSL functions of i that load the arrays, and the contents of the buffer that holds them."""
    accessors: list[str] = []
    words: list[NDArray[np.uint32]] = []
    offset = 0
    for name, array in values.items():
        kind = "u32" if array.dtype.kind in "ui" else "f32"
        data: NDArray = np.ascontiguousarray(array, np.uint32 if kind == "u32" else np.float32)
        components = 1 if data.ndim == 1 else data.shape[1]
        loads = ", ".join(f"bitcast<{kind}>(input[{offset}u + {components}u * i + {k}u])" for k in range(components))
        of_type = kind if components == 1 else f"vec{components}f"
        accessors.append(f"fn {name}(i: u32) -> {of_type} {{ return {of_type}({loads}); }}")
        words.append(data.view(np.uint32).ravel())
        offset += data.size
    return "\n".join(accessors), np.concatenate([*words, np.zeros(1, np.uint32)])
