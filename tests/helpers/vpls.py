"""Makes tables of virtual point lights on the CPU, and gathers their light at the pixels of a scene."""

from __future__ import annotations

import numpy as np
import wgpu

from wgpu_gi.camera import Camera
from wgpu_gi.gpu.device import open_device
from wgpu_gi.gpu.graph import Graph
from wgpu_gi.gpu.wgsl.load import load
from wgpu_gi.scene.scene import Scene
from wgpu_gi.techniques.many_light.compensation import declare_compensation
from wgpu_gi.techniques.many_light.denoise import DenoiseSettings, declare_denoise
from wgpu_gi.techniques.many_light.gather import GatherSettings, declare_gather
from wgpu_gi.techniques.many_light.vpl import Vpls
from wgpu_gi.techniques.shared.gbuffer import declare_gbuffer
from wgpu_gi.techniques.shared.scene_inputs import share_raster
from wgpu_gi.upload.scene_upload import SceneUpload

WIDTH = int(load("many_light/vpl/table.wgsl").constants["VPL_TABLE_WIDTH"])


def octahedral_code(normals: np.ndarray) -> np.ndarray:
    """Encode unit vectors (n, 3) like WGSL's pack2x16snorm(octahedral_encode(v))."""
    p = normals / np.abs(normals).sum(-1, keepdims=True)
    folded = (1 - np.abs(p[:, 1::-1])) * np.where(p[:, :2] >= 0, 1, -1)
    code = np.where(p[:, 2:] < 0, folded, p[:, :2])
    return np.round(code * 32767).astype(np.int16).view(np.uint32)[:, 0]


def vpl_texels(position: object, normal: object, flux: object, area: object) -> np.ndarray:
    """Return the table of n VPLs, (rows, WIDTH, 4) uint32; `flux` (n, 3) W, `area` (n,) m2."""
    positions = np.asarray(position, np.float32)
    texels = np.zeros((len(positions), 2, 4), np.uint32)
    texels[:, 0, :3] = positions.view(np.uint32)
    texels[:, 0, 3] = octahedral_code(np.asarray(normal, np.float64))
    texels[:, 1, :3] = np.asarray(flux, np.float32).view(np.uint32)
    texels[:, 1, 3] = np.asarray(area, np.float32).view(np.uint32)
    rows = -(-2 * len(positions) // WIDTH)
    table = np.zeros((rows * WIDTH, 4), np.uint32)
    table[: 2 * len(positions)] = texels.reshape(-1, 4)
    return table.reshape(rows, WIDTH, 4)


class Gatherer:
    """A scene seen by a camera, to be lit by VPLs; positions are relative to the scene's origin."""

    def __init__(self, scene: Scene, size: tuple[int, int], camera: Camera | None = None, diffuse: bool = True) -> None:
        self.device = open_device(large_buffers=True)
        self.size = size
        self.upload = SceneUpload(self.device, diffuse)
        self.upload.update(scene)
        self.upload.update_draws(scene)
        self.graph = Graph(self.device)
        self.graph.uniform("scene", self.upload.info)
        for name in ("sequence", "still_sequence"):
            self.graph.uniform(name, np.zeros((), load("scene/sequence.wgsl").struct_dtype("Sequence")))
        self.graph.uniform("view", self.upload.view(camera or scene.cameras[0], size, False))

    def __call__(
        self,
        table: np.ndarray,
        count: int,
        blur: bool = True,
        compensated: bool = False,
        stride: int = 1,
        **settings: object,
    ) -> np.ndarray:
        """Return the indirect radiance, (h, w, 3); every buffer is checked.

        Pixels are blurred over the squares that share the VPLs. With `compensated`, the light of the scene's lights
        that the bound removes is added; it has one bounce. Every `stride`-th pixel of a row and a column gathers.
        """
        graph, gpu = self.graph, self.device.gpu
        usage = wgpu.TextureUsage.STORAGE_BINDING | wgpu.TextureUsage.COPY_DST | wgpu.TextureUsage.TEXTURE_BINDING
        size = (table.shape[1], table.shape[0], 1)
        texture = gpu.create_texture(size=size, format="rgba32uint", usage=usage)
        gpu.queue.write_texture({"texture": texture}, table, {"bytes_per_row": 16 * size[0]}, size)
        graph.begin(self.size)
        scene = share_raster(graph, self.upload)
        gbuffer = declare_gbuffer(graph, scene)[0]
        vpls = Vpls(graph.share("vpl/table", texture), count)
        choice = GatherSettings(**{"visibility": "none", "compensation": compensated, **settings})
        gathered = declare_gather(graph, choice, scene, gbuffer, vpls, None, 0, stride=stride)
        declare_compensation(graph, scene, gbuffer, graph.neutral("texture_2d"), vpls, gathered, 1, 0)
        radius = choice.interleave if blur else 1
        indirect = declare_denoise(graph, DenoiseSettings(radius), scene, gbuffer, gathered, 1)[0]
        graph.compile([indirect])
        graph.run(force=True, check=True)
        pixels = graph.read_back(indirect).reshape(self.size[1], self.size[0], 4)
        texture.destroy()
        return pixels[..., :3].astype(np.float64)
