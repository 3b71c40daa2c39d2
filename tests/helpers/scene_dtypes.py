"""The numpy types of a scene's buffers and tables, as the shaders declare them."""

from __future__ import annotations

from wgpu_gi.gpu.wgsl.load import load
from wgpu_gi.upload.scene_upload import STRUCTS

DTYPES = {name: load("scene/lights.wgsl").struct_dtype(struct) for name, struct in STRUCTS.items()}
