"""Evaluates functions of the WGSL libraries on arrays: one invocation per row, results as numpy arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import wgpu

from wgpu_gi.camera import Camera
from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.gpu.wgsl.load import load, refresh
from wgpu_gi.scene.scene import Scene
from wgpu_gi.techniques.shared.scene_inputs import share_scene
from wgpu_gi.upload.scene_upload import SceneUpload

WIDTHS = {"f32": 1, "u32": 1, "vec2f": 2, "vec3f": 3, "vec4f": 4}


class Evaluator:
    """Calls WGSL: `evaluate("common/math.wgsl", "luminance(color(i))", "f32", color=array)`."""

    def __init__(self, folder: Path) -> None:
        self.device = open_device(large_buffers=True)
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
        **arrays: np.ndarray,
    ) -> np.ndarray:
        """Return `expression` for every index i, (n,) or (n, components).

        `arrays` are float32 or uint32 of n rows, of one to four components if float; in WGSL they are functions of i.
        `functions` is WGSL code for the expression. With `scene` the scene's buffers and uniforms are bound.
        """
        n = count or max(map(len, arrays.values()))
        graph = Graph(self.device, shader_root=self.folder)
        # One buffer holds all arrays: the scene needs most of the eight that WebGPU guarantees.
        accessors, words, offset = [], [], 0
        for name, array in arrays.items():
            kind = "u32" if np.asarray(array).dtype.kind in "ui" else "f32"
            data = np.ascontiguousarray(array, np.uint32 if kind == "u32" else np.float32)
            components = 1 if data.ndim == 1 else data.shape[1]
            loads = ", ".join(
                f"bitcast<{kind}>(input[{offset}u + {components}u * i + {k}u])" for k in range(components)
            )
            of_type = kind if components == 1 else f"vec{components}f"
            accessors.append(f"fn {name}(i: u32) -> {of_type} {{ return {of_type}({loads}); }}")
            words.append(data.view(np.uint32).ravel())
            offset += data.size
        contents = np.concatenate([*words, np.zeros(1, np.uint32)])
        buffer = self.device.gpu.create_buffer_with_data(data=contents, usage=wgpu.BufferUsage.STORAGE)
        width = WIDTHS[returns]
        parts = ["value"] if width == 1 else [f"value.{'xyzw'[k]}" for k in range(width)]
        stores = "".join(f"  result[{width}u * i + {k}u] = bitcast<u32>({part});\n" for k, part in enumerate(parts))
        (self.folder / "evaluate.wgsl").write_text(
            f'#import "{library}"\n'
            + "@group(1) @binding(20) var<storage, read> input: array<u32>;\n"
            + "@group(1) @binding(21) var<storage, read_write> result: array<u32>;\n"
            + "\n".join(accessors)
            + "\n"
            + functions
            + "\n@compute @workgroup_size(64)\nfn main(@builtin(global_invocation_id) id: vec3u) {\n"
            + f"  let i = id.x;\n  if (i >= {n}u) {{ return; }}\n  let value: {returns} = {expression};\n{stores}}}\n"
        )
        refresh()
        graph.begin()
        handles = {"input": graph.share("input", buffer)} if arrays else {}
        constants = {}
        if scene is not None:
            source = load("evaluate.wgsl", self.folder)
            upload = SceneUpload(self.device)
            upload.update(scene)
            graph.uniform("scene", upload.info)
            graph.uniform("view", upload.view(Camera(), (1, 1), False))
            inputs = share_scene(graph, upload)
            used = source.entry_points["main"].uses
            handles |= {k: h for k, h in {**inputs.surfaces, **inputs.lights}.items() if k in used}
            constants = {k: v for k, v in inputs.features.items() if k in source.overrides}
        output = graph.buffer("result", dtype=np.uint32, count=n * width)
        graph.compute(
            "evaluate", "evaluate.wgsl", over=n, reads=handles, writes={"result": output}, constants=constants
        )
        graph.compile([output])
        graph.run()
        result = graph.read_back(output)
        graph.release()
        buffer.destroy()
        if returns != "u32":
            result = result.view(np.float32)
        return result if width == 1 else result.reshape(n, width)
