"""Damages small valid files of every format and loads them: each gives a checked result or a GiError of one sentence.

`python fuzz.py SEED COUNT [FORMAT ...]` loads COUNT damaged files of each format in this process, under limits of time
and memory. It prints a line that begins with a dot before each file, and a line for each that broke the rule. Whatever
else appears on the terminal comes from a library and breaks the rule as well.
"""

from __future__ import annotations

import copy
import io
import json
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from unit.gltf_builder import TRIANGLE, GltfBuilder, encode, glb_bytes

from wgpu_gi.errors import GiError
from wgpu_gi.pictures.image import load_image, save_image
from wgpu_gi.scene import load as loading
from wgpu_gi.scene.check import check_camera, check_scene
from wgpu_gi.scene.files.camera_files import load_camera
from wgpu_gi.scene.files.camera_paths import load_camera_path
from wgpu_gi.scene.files.environment_files import load_environment
from wgpu_gi.scene.files.light_texts import parse_light, relight
from wgpu_gi.scene.files.notes import Notes
from wgpu_gi.scene.scene import Environment, PointLight, Scene
from wgpu_gi.scene.usd.stage import prepare_usd

SECONDS = 5  # for one file, on a busy machine
MAX_MEMORY = 64 << 20
EXTRA_MEMORY = 1 << 30  # address space above what the process has after importing everything
# OpenUSD itself ends the process on some damaged binary files: the 79th of seed 8 claims more memory than there is.
FRAGILE = {"usdc bytes": 25, "usdz bytes": 25}

Files = dict[str, bytes]  # the first one is damaged and loaded

# ------------------------------------------------------------------------------------------------ Valid files


def gltf_document(animated: bool = False) -> tuple[dict[str, Any], bytes]:
    """Return JSON and data of a file with every part of the format and all extensions, except animations unless asked.

    Animations keep skins and morph targets from being applied at loading.
    """
    builder = GltfBuilder()
    pixels = np.random.default_rng(0).integers(0, 256, (4, 4, 3)).astype(np.uint8)
    first = builder.texture(pixels, {"wrapS": 33071, "magFilter": 9728})
    second = builder.texture(pixels, kind="JPEG")
    third = builder.add("textures", {"extensions": {"EXT_texture_webp": {"source": builder.image(pixels, "WEBP")}}})
    transform = {"KHR_texture_transform": {"offset": [0, 0.5], "scale": [2, 1], "rotation": 1, "texCoord": 1}}
    material = builder.material(
        name="m",
        pbrMetallicRoughness={
            "baseColorFactor": [1, 0.5, 1, 1],
            "metallicFactor": 0.5,
            "roughnessFactor": 0.25,
            "baseColorTexture": {"index": first},
            "metallicRoughnessTexture": {"index": third},
        },
        normalTexture={"index": second, "scale": 0.5, "extensions": transform},
        emissiveTexture={"index": first},
        emissiveFactor=[1, 1, 0.5],
        alphaMode="MASK",
        alphaCutoff=0.3,
        doubleSided=True,
        extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 2}, "KHR_materials_unlit": {}},
    )
    primitive = builder.primitive(
        TRIANGLE,
        np.array([0, 1, 2], np.uint16),
        material=material,
        NORMAL=np.ones((3, 3), np.float32),
        TANGENT=np.ones((3, 4), np.float32),
        TEXCOORD_0=np.zeros((3, 2), np.float32),
        COLOR_0=np.ones((3, 4), np.float32),
        JOINTS_0=np.zeros((3, 4), np.uint8),
        WEIGHTS_0=np.ones((3, 4), np.float32),
    )
    builder.json["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": builder.view(b"\1\0\0\0"), "componentType": 5121},
        "values": {"bufferView": builder.view(np.ones(3, np.float32).tobytes())},
    }
    moves = np.tile(np.float32([0, 0, 1]), (3, 1))
    primitive["targets"] = [{"POSITION": builder.accessor(moves), "NORMAL": builder.accessor(moves)}, {"POSITION": 0}]
    mesh = builder.mesh(primitive, name="shape", weights=[0.5, 0.25])
    child = builder.node(root=False, mesh=mesh, name="child", scale=[1, 2, 1])
    builder.node(mesh=mesh, rotation=[0, 0, 0, 1], translation=[1, 2, 3], children=[child])
    inverse = builder.accessor(np.eye(4, dtype="f4").reshape(1, 16))
    builder.add("skins", {"joints": [child], "inverseBindMatrices": inverse})
    builder.node(mesh=mesh, skin=0, weights=[1, 0])
    builder.light(type="spot", spot={"outerConeAngle": 0.5}, intensity=2, color=[1, 1, 1], range=5)
    builder.light(type="directional", node={"rotation": [0.6, 0, 0, 0.8]})
    perspective = builder.add("cameras", {"type": "perspective", "perspective": {"yfov": 1}})
    parallel = builder.add("cameras", {"type": "orthographic", "orthographic": {"ymag": 1, "xmag": 1, "zfar": 9}})
    builder.node(camera=perspective, matrix=np.eye(4).ravel().tolist())
    builder.node(camera=parallel)
    shiny = {
        "diffuseTexture": {"index": first},
        "specularGlossinessTexture": {"index": second},
        "glossinessFactor": 0.5,
    }
    shiny |= {"diffuseFactor": [1, 0.5, 1, 1], "specularFactor": [0.5, 0.5, 1]}
    second_material = builder.material(extensions={"KHR_materials_pbrSpecularGlossiness": shiny})
    pair = builder.mesh(
        builder.primitive(mode=5), builder.primitive(material=second_material), builder.primitive(mode=0)
    )
    places = {"TRANSLATION": builder.accessor(moves), "SCALE": builder.accessor(np.ones((3, 3), np.float32))}
    places["ROTATION"] = builder.accessor(np.full((3, 4), 0.5, np.float32))
    copies = {"EXT_mesh_gpu_instancing": {"attributes": places}, "KHR_node_visibility": {"visible": True}}
    builder.node(mesh=pair, extensions=copies)
    _add_compressed(builder)
    if animated:
        _add_animations(builder, child)
    builder.glb_bytes()
    return builder.json, bytes(builder.data)


def _add_animations(builder: GltfBuilder, child: int) -> None:
    """Add two animations with all interpolations, of nodes, weights and pointers."""
    times = builder.accessor(np.float32([0, 0.5, 1]))
    turns = builder.accessor((np.eye(4)[[3, 0, 1]] * 127).astype(np.int8), normalized=True)
    spline = builder.accessor(np.random.default_rng(1).random((9, 3)).astype(np.float32))
    weights = builder.accessor(np.linspace(0, 1, 6).astype(np.float32))
    single, steps = builder.accessor(np.float32([0, 1, 0.5])), builder.accessor(np.eye(3, dtype=np.float32))
    lights, material = "/extensions/KHR_lights_punctual/lights/0", "/materials/0"
    layer = f"{material}/extensions/KHR_materials_emissive_strength/emissiveStrength"
    targets = [
        (turns, "LINEAR", {"node": child, "path": "rotation"}),
        (spline, "CUBICSPLINE", {"node": child, "path": "translation"}),
        (steps, "STEP", {"node": child, "path": "scale"}),
        (weights, "LINEAR", {"node": child + 2, "path": "weights"}),
        *((single, "LINEAR", f"{lights}/{name}") for name in ("intensity", "range", "spot/outerConeAngle")),
        *((steps, "LINEAR", path) for path in (f"{lights}/color", f"{material}/emissiveFactor", "/nodes/1/scale")),
        *((single, "STEP", path) for path in ("/cameras/0/perspective/yfov", layer, "/nodes/0/weights/1")),
    ]
    for chosen in (targets, targets[:2]):
        samplers, channels = [], []
        for output, interpolation, target in chosen:
            if isinstance(target, str):
                target = {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": target}}}
            channels.append({"sampler": len(samplers), "target": target})
            samplers.append({"input": times, "output": output, "interpolation": interpolation})
        builder.add("animations", {"name": "move", "samplers": samplers, "channels": channels})


def _add_compressed(builder: GltfBuilder) -> None:
    """Add a mesh in Draco's and one in meshopt's encoding, where the packages are installed."""
    element = {"count": 30, "type": "VEC3", "componentType": 5126}
    points = np.random.default_rng(2).random((30, 3)).astype(np.float32)
    try:
        import DracoPy
        import meshoptimizer
    except ImportError:
        return
    for level in (0, 7):
        stream = DracoPy.encode(points, np.arange(30, dtype=np.uint32).reshape(10, 3), compression_level=level)
        draco = {"bufferView": builder.view(stream), "attributes": {"POSITION": 0}}
        attributes = {"POSITION": builder.add("accessors", dict(element))}
        extensions = {"KHR_draco_mesh_compression": draco}
        builder.node(mesh=builder.mesh({"attributes": attributes, "extensions": extensions}))
    stored = builder.view(meshoptimizer.encode_vertex_buffer(points))
    keys = builder.json["bufferViews"][stored] | {"byteStride": 12, "count": 30, "mode": "ATTRIBUTES"}
    view = {"buffer": 0, "byteLength": 360, "extensions": {"EXT_meshopt_compression": keys}}
    position = builder.add("accessors", {**element, "bufferView": builder.add("bufferViews", view)})
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": position}}))


MTL = "newmtl m\nKd 0.5 0.4 0.3\nKe 1 2 3\nd 0.5\nmap_Kd -s 1 1 1 t.png\nmap_Ke t.png\n"
OBJ = """mtllib m.mtl
v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1
vt 0 0\nvt 1 0\nvn 0 0 1\nusemtl m\nf 1/1/1 2/2/1 3/1/1 4/2/1\nf -4 -3 -1\n"""
PLY = """ply\nformat ascii 1.0\ncomment a\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z
property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue
element face 2\nproperty list uchar int vertex_indices\nend_header
0 0 0 0 0 1 255 0 0\n1 0 0 0 0 1 0 255 0\n1 1 0 0 0 1 0 0 255\n0 1 0 0 0 1 9 9 9\n3 0 1 2\n3 0 2 3\n"""
STL = "solid a\n" + 2 * (
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
) + "endsolid a\n"  # fmt: skip
OFF = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3 255 0 0\n"
CAMERA = {"position": [0, 1, 5], "target": [0, 1, 0], "up": [0, 1, 0], "yfov_deg": 50, "orthographic_height": 2.5}
LIGHTS = ["sun 0.3,-1,0.2 3,3,2.8", "point 1,2,3 5", "0=1,2,3", "env=1,2,3 45", "sun=1,1,1 0,-1,0"]


def binary_ply() -> bytes:
    """Return a binary PLY file of two triangles."""
    head, _, _ = PLY.partition("end_header\n")
    vertex = np.dtype([("p", "<f4", 6), ("c", "u1", 3)])
    face = np.dtype([("n", "u1"), ("v", "<i4", 3)])
    vertices, faces = np.zeros(4, vertex), np.zeros(2, face)
    vertices["p"][:, :2] = [[0, 0], [1, 0], [1, 1], [0, 1]]
    faces["n"], faces["v"] = 3, [[0, 1, 2], [0, 2, 3]]
    header = head.replace("ascii", "binary_little_endian") + "end_header\n"
    return header.encode() + vertices.tobytes() + faces.tobytes()


def binary_stl() -> bytes:
    """Return a binary STL file of two triangles."""
    record = np.dtype([("n", "<f4", 3), ("v", "<f4", 9), ("a", "<u2")])
    triangles = np.zeros(2, record)
    triangles["v"] = [0, 0, 0, 1, 0, 0, 0, 1, 0]
    return bytes(80) + (2).to_bytes(4, "little") + triangles.tobytes()


USD = """#usda 1.0
(
    upAxis = "Z"
    metersPerUnit = 0.01
    startTimeCode = 1
    endTimeCode = 5
)
def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    uniform bool doubleSided = 1
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.2, 0.3, 0)]
    int[] faceVertexCounts = [3, 5]
    int[] faceVertexIndices = [0, 1, 2, 0, 1, 2, 3, 4]
    int[] holeIndices = []
    normal3f[] normals = [(0, 0, 1), (0, 1, 0)] (interpolation = "uniform")
    texCoord2f[] primvars:st = [(0, 0), (1, 1), (0.5, 0)] (interpolation = "faceVarying")
    int[] primvars:st:indices = [0, 1, 2, 0, 1, 2, 0, 1]
    color3f[] primvars:displayColor = [(1, 0.5, 0)]
    uniform token subdivisionScheme = "catmullClark"
    double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 5: (1, 2, 3) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    rel material:binding = </a>
    def GeomSubset "part" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </a>
    }
}
def PointInstancer "i"
{
    rel prototypes = [</i/p>]
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (5, 5, 5)]
    quath[] orientations = [(1, 0, 0, 0), (0, 1, 0, 0)]
    def Cone "p"
    {
        double radius = 2
        uniform token axis = "X"
    }
}
def Points "q"
{
    point3f[] points = [(0, 0, 1), (2, 0, 1)]
    float[] widths = [0.1, 0.2]
}
def Material "a"
{
    token outputs:surface.connect = </a/s.outputs:surface>
    def Shader "s"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </a/t.outputs:rgb>
        float inputs:roughness.connect = </a/t.outputs:g>
        float inputs:opacity.connect = </a/t.outputs:a>
        float inputs:opacityThreshold = 0.5
        color3f inputs:emissiveColor = (1, 2, 3)
        token outputs:surface
    }
    def Shader "t"
    {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @t.png@
        float4 inputs:scale = (1, 0.5, 1, 1)
        float2 inputs:st.connect = </a/x.outputs:result>
        token inputs:wrapS = "mirror"
        float3 outputs:rgb
        float outputs:g
        float outputs:a
    }
    def Shader "x"
    {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </a/r.outputs:result>
        float inputs:rotation = 30
        float2 inputs:scale = (2, 3)
        float2 outputs:result
    }
    def Shader "r"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
def SphereLight "l1" (prepend apiSchemas = ["ShapingAPI"])
{
    float inputs:intensity = 3
    float inputs:exposure = 2
    float inputs:radius = 0.5
    float inputs:shaping:cone:angle = 40
    bool inputs:normalize = 1
}
def RectLight "l2"
{
    color3f inputs:color = (1, 0.5, 0.25)
    float inputs:width = 3
    bool inputs:enableColorTemperature = 1
}
def DistantLight "l3"
{
    float inputs:angle = 5
}
def DomeLight "l4"
{
    asset inputs:texture:file = @t.png@
    double3 xformOp:rotateXYZ = (90, 20, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
def Camera "c"
{
    float focalLength = 35
    float verticalAperture = 20
    token projection = "perspective"
}
"""


def usd_files() -> dict[str, Files]:
    """Return a stage as text, in binary and in an archive; none without usd-core."""
    prepare_usd()
    try:
        from pxr import Usd, UsdUtils
    except ImportError:
        return {}
    texture = {"t.png": picture("PNG")}
    found = {"usda": {"s.usda": USD.encode(), **texture}}
    with tempfile.TemporaryDirectory() as folder:
        for name, data in found["usda"].items():
            (Path(folder) / name).write_bytes(data)
        Usd.Stage.Open(f"{folder}/s.usda").Export(f"{folder}/s.usdc")
        UsdUtils.CreateNewUsdzPackage(f"{folder}/s.usdc", f"{folder}/s.usdz")
        found["usdc"] = {"s.usdc": (Path(folder) / "s.usdc").read_bytes(), **texture}
        found["usdz"] = {"s.usdz": (Path(folder) / "s.usdz").read_bytes()}
    return found


def hdr(runs: bool) -> bytes:
    """Return a Radiance picture of 16 x 8 pixels, run-length encoded in the new or the old way."""
    row = bytes([2, 2, 0, 16]) + bytes([128 + 16, 90]) * 3 + bytes([16]) + bytes(range(120, 136))
    old = bytes([10, 20, 30, 128, 1, 1, 1, 15])
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 8 +X 16\n" + (row if runs else old) * 8


def saved(suffix: str) -> bytes:
    """Return a picture of two layers (one for .png and .npy) as a file."""
    values = np.random.default_rng(0).random((4, 8, 3)).astype(np.float32)
    layers = {"radiance": values} | ({"depth": values[..., 0]} if suffix in (".exr", ".npz") else {})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        save_image(path, layers)
        return path.read_bytes()


def picture(kind: str) -> bytes:
    """Return an 8-bit picture, 16-bit for TIFF."""
    pixels = np.random.default_rng(0).integers(0, 256, (4, 8, 3)).astype(np.uint8)
    if kind not in ("TIFF", "GIF"):
        return encode(pixels, kind)
    stream = io.BytesIO()
    Image.fromarray(pixels[..., 0].astype(np.uint16) * 200 if kind == "TIFF" else pixels).save(stream, kind)
    return stream.getvalue()


# ------------------------------------------------------------------------------------------------ Damage

STRANGE = [None, True, -1, 0, 1, 7, 2.5, 1e300, 1e-300, 1e39, 10**30, 1e308 * 10, float("nan"), "", "x", "\0", "1"]
STRANGE += [
    [],
    {},
    [0],
    [None] * 3,
    {"a": []},
    [1e300] * 3,
    [[0] * 3] * 3,
    4294967295,
    2**53,
    -(2**31),
    "\ud800",
    65536,
]
WORDS = [
    "",
    "-1",
    "0",
    "1e400",
    "1e39",
    "-1e300",
    "1e-300",
    "nan",
    "inf",
    "99999999999",
    "2147483648",
    "x",
    "1.5",
    "\0",
]
WORDS += ["4294967295", "é", "1/2/3/4", "-0", "+", "0x10", "1_0", "٣", "," * 5, "9" * 5000, "-" * 9]


def damaged_bytes(data: bytes, rng: random.Random) -> bytes:
    """Return a copy with bytes changed, cut, repeated or inserted."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        at = rng.randrange(len(changed)) if changed else 0
        kind = rng.randrange(7)
        if kind < 3 and changed:
            changed[at] = rng.choice((0, 1, 127, 128, 255, rng.randrange(256)))
        elif kind == 3:
            del changed[at : at + rng.choice((1, 4, len(changed)))]
        elif kind == 4:
            changed[at:at] = changed[at : at + rng.choice((1, 8, 64))]
        elif kind == 5:
            changed[at:at] = bytes(rng.choice((1, 4, 100)))
        else:
            changed[at : at + 4] = rng.choice((0, 1, 2**31, 2**32 - 1, 2**24)).to_bytes(
                4, rng.choice(("little", "big"))
            )
    return bytes(changed)


def damaged_text(data: bytes, rng: random.Random) -> bytes:
    """Return a copy with words replaced, or lines dropped, repeated or swapped."""
    text = data.decode()
    for _ in range(rng.choice((1, 1, 2, 4))):
        lines = text.split("\n")
        at = rng.randrange(len(lines))
        kind = rng.randrange(6)
        if kind < 3:
            parts = re.split(r"([\s,/=:]+)", lines[at])
            parts[rng.randrange(len(parts))] = rng.choice(WORDS)
            lines[at] = "".join(parts)
        elif kind == 3:
            del lines[at]
        elif kind == 4:
            lines[at:at] = [lines[at]] * rng.choice((1, 3, 300))
        else:
            other = rng.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        text = "\n".join(lines)
    return text.encode("utf-8", "surrogatepass")


def damaged_json(value: Any, rng: random.Random) -> Any:
    """Return a copy of a JSON value with random parts replaced, dropped or repeated."""
    value = json.loads(json.dumps(value))
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        target = value
        while isinstance(target, (dict, list)) and target:
            key = rng.choice(list(target) if isinstance(target, dict) else range(len(target)))
            if isinstance(target[key], (dict, list)) and target[key] and rng.random() < 0.9:
                target = target[key]
                continue
            kind = rng.random()
            if kind < 0.15:
                del target[key]
            elif kind < 0.25 and isinstance(target, list):
                target.append(copy.deepcopy(target[key]))
            elif kind < 0.4 and isinstance(target[key], (int, float)):
                target[key] = target[key] * rng.choice((-1, 2, 0.5, 1e6)) + rng.choice((-1, 0, 1))
            else:
                target[key] = copy.deepcopy(rng.choice(STRANGE))
            break
    return value


# ------------------------------------------------------------------------------------------------ Formats


def read_scene(path: Path) -> None:
    """Load a scene; it must be one that renders."""
    scene = loading.read_scene(path, max_memory=MAX_MEMORY)
    check_scene(scene)
    assert scene.triangle_count and np.isfinite(scene.bounds()).all() and all("\n" not in note for note in scene.notes)
    for camera in scene.cameras:
        check_camera(camera)
    for number in range(len(scene.animations)):
        for seconds in (0.0, 0.3, 0.75, 1e9):
            posed = scene.at(seconds, number)
            check_scene(posed)
            assert np.isfinite(posed.bounds()).all()
            for camera in posed.cameras:
                check_camera(camera)


def read_environment(path: Path) -> None:
    """Load an environment map."""
    check_scene(Scene(environment=load_environment(path, Notes(), max_memory=MAX_MEMORY)))


def read_cameras(path: Path) -> None:
    """Load a camera, or a path of cameras."""
    if path.read_bytes().lstrip()[:1] == b"[":
        at = load_camera_path(path)
        for frame in (-5, 0, 3, 7, 1000):
            check_camera(at(frame))
    else:
        check_camera(load_camera(path))


def read_lights(path: Path) -> None:
    """Read each line as a new light and as a change of a light."""
    scene = Scene(lights=[PointLight((0, 0, 0))], environment=Environment())
    for line in path.read_text("utf-8", "surrogatepass").split("\n"):
        for read in (lambda text: scene.lights.append(parse_light(text)), lambda text: relight(scene, text)):
            try:
                read(line)
            except GiError as error:
                one_sentence(error)
    check_scene(scene)


def one_sentence(error: GiError) -> None:
    """Check a message."""
    text = str(error)
    assert text and "\n" not in text and len(text) < 600 and "Traceback" not in text, text[:2000]


def formats() -> dict[str, tuple[Files, Callable[[bytes, random.Random], bytes], Callable[[Path], None]]]:
    """Return for each format its files, how to damage the first, and how to read it."""
    document, data = gltf_document()
    glb = glb_bytes(json.dumps(document).encode(), data)
    moving, keys = gltf_document(animated=True)
    moving_glb = glb_bytes(json.dumps(moving).encode(), keys)
    beside = {"b.bin": data}
    linked = document | {"buffers": [{"byteLength": len(data), "uri": "b.bin"}]}
    texture, library = {"t.png": picture("PNG")}, {"m.mtl": MTL.encode()}
    path = [{"frame": 0, **CAMERA}, {"frame": 5, **CAMERA, "position": [1, 2, 3]}, {"frame": 9, **CAMERA}]
    for key in path:
        del key["orthographic_height"]

    def json_damage(value: Any, wrap: Callable[[bytes], bytes] = bytes) -> Callable[[bytes, random.Random], bytes]:
        return lambda _, rng: wrap(json.dumps(damaged_json(value, rng)).encode())

    # The file named first is damaged; a name "load" among the others is loaded in its place.
    found: dict[str, Any] = {
        "glb json": ({"s.glb": glb}, json_damage(document, lambda text: glb_bytes(text, data)), read_scene),
        "glb bytes": ({"s.glb": glb}, damaged_bytes, read_scene),
        "moving json": ({"s.glb": moving_glb}, json_damage(moving, lambda text: glb_bytes(text, keys)), read_scene),
        "moving bytes": ({"s.glb": moving_glb}, damaged_bytes, read_scene),
        "gltf json": ({"s.gltf": json.dumps(linked).encode(), **beside}, json_damage(linked), read_scene),
        "gltf text": ({"s.gltf": json.dumps(linked, indent=1).encode(), **beside}, damaged_text, read_scene),
        "gltf buffer": ({"b.bin": data, "s.gltf": json.dumps(linked).encode()}, damaged_bytes, read_scene),
        "obj text": ({"s.obj": OBJ.encode(), **library, **texture}, damaged_text, read_scene),
        "obj bytes": ({"s.obj": OBJ.encode(), **library, **texture}, damaged_bytes, read_scene),
        "mtl text": ({"m.mtl": MTL.encode(), "s.obj": OBJ.encode(), **texture}, damaged_text, read_scene),
        "mtl bytes": ({"m.mtl": MTL.encode(), "s.obj": OBJ.encode(), **texture}, damaged_bytes, read_scene),
        "ply text": ({"s.ply": PLY.encode()}, damaged_text, read_scene),
        "ply ascii bytes": ({"s.ply": PLY.encode()}, damaged_bytes, read_scene),
        "ply bytes": ({"s.ply": binary_ply()}, damaged_bytes, read_scene),
        "stl text": ({"s.stl": STL.encode()}, damaged_text, read_scene),
        "stl ascii bytes": ({"s.stl": STL.encode()}, damaged_bytes, read_scene),
        "stl bytes": ({"s.stl": binary_stl()}, damaged_bytes, read_scene),
        "off text": ({"s.off": OFF.encode()}, damaged_text, read_scene),
        "off bytes": ({"s.off": OFF.encode()}, damaged_bytes, read_scene),
        "hdr new": ({"e.hdr": hdr(True)}, damaged_bytes, read_environment),
        "hdr old": ({"e.hdr": hdr(False)}, damaged_bytes, read_environment),
        "exr": ({"e.exr": saved(".exr")}, damaged_bytes, read_environment),
        "camera json": ({"c.json": json.dumps(CAMERA).encode()}, json_damage(CAMERA), read_cameras),
        "camera text": ({"c.json": json.dumps(CAMERA, indent=1).encode()}, damaged_text, read_cameras),
        "camera bytes": ({"c.json": json.dumps(CAMERA).encode()}, damaged_bytes, read_cameras),
        "camera path": ({"c.json": json.dumps(path).encode()}, json_damage(path), read_cameras),
        "lights": ({"l.txt": "\n".join(LIGHTS).encode()}, damaged_text, read_lights),
    }
    usd = usd_files()
    for name, files in usd.items():
        found[f"{name} bytes"] = (files, damaged_bytes, read_scene)
    if usd:
        found["usda text"] = (usd["usda"], damaged_text, read_scene)
    for kind in ("PNG", "JPEG", "WEBP", "TIFF", "GIF", "BMP"):
        files = {"t.png": picture(kind), "s.obj": OBJ.encode(), **library}
        found[f"texture {kind.lower()}"] = (files, damaged_bytes, read_scene)
    for suffix in (".png", ".exr", ".npy", ".npz"):
        found[f"picture {suffix[1:]}"] = ({f"p{suffix}": saved(suffix)}, damaged_bytes, load_image)
    return found


def broken_rule(read: Callable[[Path], None], path: Path) -> str | None:
    """Load a file; return what it did apart from succeeding or raising a GiError of one sentence."""

    def late(number: int, frame: Any) -> None:
        raise TimeoutError

    signal.signal(signal.SIGALRM, late)
    signal.alarm(SECONDS)
    start = time.process_time()
    try:
        try:
            read(path)
        except GiError as error:
            one_sentence(error)
        seconds = time.process_time() - start
        return f"took {seconds:.1f} s" if seconds > 2 else None
    except BaseException as error:
        where = [f"{Path(f.filename).name}:{f.lineno}" for f in traceback.extract_tb(error.__traceback__)[-4:]]
        return f"{type(error).__name__} {str(error)[:200]!r} at {' '.join(where)}"
    finally:
        signal.alarm(0)


def main(seed: int, count: int, only: list[str]) -> None:
    """Damage and load; print a line for each file that broke the rule."""
    cases = formats()
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name, (files, _, read) in cases.items():
            # Loading the undamaged file imports everything that the format needs.
            place = root / name.replace(" ", "_")
            place.mkdir()
            for file, data in files.items():
                (place / file).write_bytes(data)
            target = place / next((f for f in files if f.startswith("s.")), next(iter(files)))
            fault = broken_rule(read, target)
            if fault:
                print(f"{name}: undamaged: {fault}", flush=True)
        pages = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        resource.setrlimit(resource.RLIMIT_AS, (pages + EXTRA_MEMORY, pages + EXTRA_MEMORY))
        for name, (files, damage, read) in cases.items():
            if only and name not in only:
                continue
            place = root / name.replace(" ", "_")
            target = place / next((f for f in files if f.startswith("s.")), next(iter(files)))
            first, data = next(iter(files.items()))
            for k in range(min(count, FRAGILE.get(name, count))):
                print(f". {name} {seed} {k}", flush=True)
                (place / first).write_bytes(damage(data, random.Random(f"{name} {seed} {k}")))
                fault = broken_rule(read, target)
                if fault:
                    print(f"{name} {seed} {k}: {fault}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
