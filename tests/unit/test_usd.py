"""OpenUSD stages written by usd-core: geometry, instances, transforms, materials, lights, cameras, time and damage."""

import math

import numpy as np
import pytest
from PIL import Image
from unit.test_mesh_files import area, world_triangles

from wgpu_gi.errors import GiError
from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.check import check_camera, check_scene
from wgpu_gi.scene.load import lit_at, load
from wgpu_gi.scene.scene import DirectionalLight, PointLight, SpotLight

pxr = pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel, UsdUtils, Vt  # noqa: E402

SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
L_SHAPE = [(0, 0, 0), (4, 0, 0), (4, 1, 0), (1, 1, 0), (1, 4, 0), (0, 4, 0)]


class Builder:
    """A stage in metres with Y up, unless told otherwise."""

    def __init__(self, folder, unit=1.0, up="Y", suffix=".usda"):
        self.path = folder / f"s{suffix}"
        self.stage = Usd.Stage.CreateNew(str(self.path))
        UsdGeom.SetStageMetersPerUnit(self.stage, unit)
        UsdGeom.SetStageUpAxis(self.stage, up)

    def mesh(self, path="/m", points=SQUARE, counts=(4,), ids=None, scheme="none"):
        mesh = UsdGeom.Mesh.Define(self.stage, path)
        mesh.CreatePointsAttr(points)
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray(counts))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray(range(sum(counts)) if ids is None else ids))
        mesh.CreateSubdivisionSchemeAttr(scheme)
        return mesh

    def material(self, path="/looks/a", bind=(), **inputs):
        """Define a UsdPreviewSurface with constants, or outputs of other shaders, and bind it to prims."""
        material = UsdShade.Material.Define(self.stage, path)
        shader = self.shader(f"{path}/surface", "UsdPreviewSurface", **inputs)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        for prim in bind:
            UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)
        return material

    def shader(self, path, identifier, **inputs):
        shader = UsdShade.Shader.Define(self.stage, path)
        shader.CreateIdAttr(identifier)
        types = {float: "Float", int: "Int", str: "Token", tuple: {2: "Float2", 3: "Color3f", 4: "Float4"}}
        for name, value in inputs.items():
            if isinstance(value, UsdShade.Output):
                shader.CreateInput(name, value.GetTypeName()).ConnectToSource(value)
                continue
            kind = "Asset" if name == "file" else types[type(value)]
            kind = kind[len(value)] if isinstance(kind, dict) else kind
            shader.CreateInput(name, getattr(Sdf.ValueTypeNames, kind)).Set(value)
        return shader

    def texture(self, path, file, output="rgb", **inputs):
        shader = self.shader(path, "UsdUVTexture", file=file, **inputs)
        kind = Sdf.ValueTypeNames.Float3 if output == "rgb" else Sdf.ValueTypeNames.Float
        return shader.CreateOutput(output, kind)

    def reader(self, path, name):
        shader = self.shader(path, "UsdPrimvarReader_float2", varname=name)
        return shader.CreateOutput("result", Sdf.ValueTypeNames.Float2)

    def primvar(self, mesh, name, values, interpolation, indices=None, kind="TexCoord2fArray"):
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(name, getattr(Sdf.ValueTypeNames, kind), interpolation)
        primvar.Set(values)
        if indices is not None:
            primvar.SetIndices(Vt.IntArray(indices))

    def load(self, **arguments):
        self.stage.GetRootLayer().Save()
        scene = load(self.path, **arguments)
        check_scene(scene)
        for camera in scene.cameras:
            check_camera(camera)
        return scene


def notes_of(scene):
    return [note for note in scene.notes if "no light" not in note and "no camera" not in note]


@pytest.fixture
def build(tmp_path):
    return lambda **arguments: Builder(tmp_path, **arguments)


# ------------------------------------------------------------------------------------------------ Geometry


@pytest.mark.parametrize("suffix", [".usd", ".usda", ".usdc"])
def test_units_and_axes(build, suffix):
    """In centimetres with Z up, a floor lies in x and y; here it lies in x and z, and faces +Y."""
    builder = build(unit=0.01, up="Z", suffix=suffix)
    builder.mesh(points=[(100 * x, 100 * y, 50) for x, y, _ in SQUARE])
    scene = builder.load()
    np.testing.assert_allclose(scene.bounds(), [[0, 0.5, -1], [1, 0.5, 0]], atol=1e-6)
    a, b, c = world_triangles(scene).transpose(1, 0, 2)
    assert area(scene) == pytest.approx(1.0) and (np.cross(b - a, c - a)[:, 1] > 0).all() and not notes_of(scene)


def test_archives(build, tmp_path):
    Image.fromarray(np.full((2, 2, 3), 100, np.uint8)).save(tmp_path / "t.png")
    builder = build()
    builder.material(bind=[builder.mesh()], diffuseColor=builder.texture("/t", "t.png"))
    builder.stage.GetRootLayer().Save()
    assert UsdUtils.CreateNewUsdzPackage(str(builder.path), str(tmp_path / "s.usdz"))
    (tmp_path / "t.png").unlink()
    scene = load(tmp_path / "s.usdz")
    assert scene.materials[0].base_color_texture.image.pixels[0, 0, 0] == 100 and not notes_of(scene)


def test_polygons_holes_and_winding(build):
    builder = build()
    builder.mesh("/concave", L_SHAPE, (6,), [1, 0, 5, 4, 3, 2])
    mesh = builder.mesh("/holes", SQUARE, (3, 3), [0, 1, 2, 0, 2, 3])
    mesh.CreateHoleIndicesAttr([1])
    left = builder.mesh("/left", SQUARE, (4,), [3, 2, 1, 0])
    left.CreateOrientationAttr("leftHanded")
    scene = builder.load()
    concave, holes, left = scene.instances
    assert [instance.mesh.triangles.shape for instance in (concave, holes, left)] == [(4, 3), (1, 3), (2, 3)]
    assert area(scene) == pytest.approx(7 + 0.5 + 1)
    a, b, c = left.mesh.positions[left.mesh.triangles].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all() and not notes_of(scene)


@pytest.mark.parametrize(
    ("interpolation", "values", "indices", "expected"),
    [
        ("vertex", [(0, 0), (1, 0), (1, 1), (0, 1)], None, [(0, 0), (1, 0), (1, 1)]),
        ("varying", [(0, 0), (1, 0), (1, 1), (0, 1)], None, [(0, 0), (1, 0), (1, 1)]),
        ("vertex", [(0, 0), (1, 1)], [0, 1, 1, 0], [(0, 0), (1, 1), (1, 1)]),
        ("faceVarying", [(0.5, 0), (1, 0), (1, 1), (0.5, 0), (1, 1), (0, 1)], None, [(0.5, 0), (1, 0), (1, 1)]),
        ("faceVarying", [(0.25, 0.5), (1, 1)], [0, 1, 0, 1, 1, 1], [(0.25, 0.5), (1, 1), (0.25, 0.5)]),
        ("uniform", [(0.25, 0.5), (1, 1)], None, [(0.25, 0.5)] * 3),
        ("constant", [(0.25, 0.5)], None, [(0.25, 0.5)] * 3),
    ],
)
def test_texture_coordinates_of_every_interpolation(build, tmp_path, interpolation, values, indices, expected):
    """The package's v points down."""
    Image.fromarray(np.zeros((2, 2, 3), np.uint8)).save(tmp_path / "t.png")
    builder = build()
    mesh = builder.mesh(counts=(3, 3), ids=[0, 1, 2, 0, 2, 3])
    builder.primvar(mesh, "uv", values, interpolation, indices)
    builder.material(bind=[mesh], diffuseColor=builder.texture("/t", "t.png", st=builder.reader("/r", "uv")))
    found = builder.load().meshes[0]
    np.testing.assert_allclose(found.texcoords0[found.triangles[0]], np.array(expected) * (1, -1) + (0, 1), atol=1e-6)


def test_normals_and_colours(build):
    builder = build()
    mesh = builder.mesh("/a", counts=(3, 3), ids=[0, 1, 2, 0, 2, 3])
    mesh.CreateNormalsAttr([(0, 0, 1), (0, 0.6, 0.8)])
    mesh.SetNormalsInterpolation("uniform")
    mesh.CreateDisplayColorPrimvar("faceVarying").Set([(1, 0, 0)] * 3 + [(0, 0, 0.5)] * 3)
    constant = builder.mesh("/b")
    constant.CreateDisplayColorAttr([(0.1, 0.2, 0.3)])
    builder.mesh("/c")
    first, second, third = builder.load().meshes
    np.testing.assert_allclose(first.normals[first.triangles[1]], [[0, 0.6, 0.8]] * 3, atol=1e-6)
    np.testing.assert_allclose(first.colors[first.triangles[:, 0]], [[1, 0, 0, 1], [0, 0, 0.5, 1]])
    assert second.colors is None and second.materials[0].base_color == pytest.approx((0.1, 0.2, 0.3, 1.0))
    assert third.materials[0].base_color == (0.8, 0.8, 0.8, 1.0) and third.normals is None


def test_subdivision_surfaces_are_smooth_and_noted(build):
    builder = build()
    ridge = [(0, 0, 0), (1, 0, 1), (2, 0, 0), (0, 1, 0), (1, 1, 1), (2, 1, 0)]
    builder.mesh(points=ridge, counts=(4, 4), ids=[0, 1, 4, 3, 1, 2, 5, 4], scheme="catmullClark")
    scene = builder.load()
    mesh = scene.meshes[0]
    crest = np.abs(mesh.positions[:, 0]) < 1e-6
    np.testing.assert_allclose(mesh.normals[crest], [[0, 0, 1]] * 2, atol=1e-6)
    assert "control meshes" in notes_of(scene)[0]


def test_subsets_have_materials(build):
    builder = build()
    mesh = builder.mesh(counts=(3, 3), ids=[0, 1, 2, 0, 2, 3])
    builder.material("/looks/whole", bind=[mesh], diffuseColor=(0.1, 0.1, 0.1))
    part = builder.material("/looks/part", diffuseColor=(0.9, 0.0, 0.0))
    subset = UsdShade.MaterialBindingAPI(mesh).CreateMaterialBindSubset("part", Vt.IntArray([1, 7]))
    UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(part)
    scene = builder.load()
    found = scene.meshes[0]
    colors = [found.materials[k].base_color[0] for k in found.material_of_triangle]
    assert colors == pytest.approx([0.1, 0.9]) and "faces that do not exist: 1" in notes_of(scene)[0]


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize(
    ("kind", "surface"),
    [("Cylinder", 2 * math.pi * 0.5 * 3 + 2 * math.pi * 0.25), ("Cone", math.pi * 0.5 * (0.5 + math.hypot(0.5, 3))),
     ("Capsule", 2 * math.pi * 0.5 * 3 + math.pi), ("Sphere", math.pi), ("Cube", 6 * 4.0), ("Plane", 2.0 * 5)],
)  # fmt: skip
def test_gprims(build, axis, kind, surface):
    """Their areas, to the 1 % that polygons lose; faces and normals point away from the middle."""
    builder = build()
    prim = getattr(UsdGeom, kind).Define(builder.stage, "/g").GetPrim()
    sizes = {"radius": 0.5, "height": 3.0, "axis": axis, "size": 2.0, "width": 2.0, "length": 5.0}
    for name, value in sizes.items():
        if prim.HasAttribute(name):
            prim.GetAttribute(name).Set(value)
    scene = builder.load()
    assert area(scene) == pytest.approx(surface, rel=0.01)
    corners = world_triangles(scene)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = "XYZ".index(axis)
    if kind == "Plane":
        assert (faces[:, along] > 0).all()
        return
    assert (np.einsum("tc,tc->t", faces, corners.mean(1)) > 0).all()
    if kind in ("Cylinder", "Capsule"):
        assert np.argmax(np.ptp(corners.reshape(-1, 3), axis=0)) == along
    mesh = scene.meshes[0]
    if mesh.normals is not None:
        assert (np.einsum("tc,tkc->tk", faces, mesh.normals[mesh.triangles]) > 0).all()


# ------------------------------------------------------------------------------------------------ Hierarchy


def test_transforms_and_native_instances(build):
    builder = build()
    builder.mesh("/proto/m")
    builder.stage.GetPrimAtPath("/proto").SetSpecifier(Sdf.SpecifierClass)
    for k in range(3):
        prim = UsdGeom.Xform.Define(builder.stage, f"/world/i{k}")
        prim.AddTranslateOp().Set((2.0 * k, 0, 0))
        prim.AddScaleOp().Set((1, 1 + k, 1))
        prim.GetPrim().GetReferences().AddInternalReference("/proto")
        prim.GetPrim().SetInstanceable(True)
    UsdGeom.Xform.Define(builder.stage, "/world").AddRotateXYZOp().Set((90, 0, 0))
    scene = builder.load()
    assert len(scene.instances) == 3 and len(scene.meshes) == 1
    np.testing.assert_allclose(scene.bounds(), [[0, 0, 0], [5, 0, 3]], atol=1e-6)


def test_point_instancers(build):
    builder = build()
    instancer = UsdGeom.PointInstancer.Define(builder.stage, "/i")
    instancer.AddScaleOp().Set((2, 2, 2))
    a = builder.mesh("/i/prototypes/a")
    b = UsdGeom.Cube.Define(builder.stage, "/i/prototypes/b")
    b.AddTranslateOp().Set((0, 0, 10))
    instancer.CreatePrototypesRel().SetTargets([a.GetPath(), b.GetPath()])
    instancer.CreateProtoIndicesAttr([0, 1, 0, 0, 9])
    instancer.CreatePositionsAttr([(0, 0, 0), (5, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)])
    instancer.CreateScalesAttr([(1, 1, 1), (2, 2, 2), (1, 1, 1), (1, 1, 1), (1, 1, 1)])
    instancer.CreateInvisibleIdsAttr([3])
    scene = builder.load()
    assert len(scene.instances) == 3 and len(scene.meshes) == 2
    assert area(scene) == pytest.approx(2 * 4 + 24 * 16)
    cube = next(instance for instance in scene.instances if instance.mesh.triangles.shape == (12, 3))
    np.testing.assert_allclose(cube.world_from_local[:3, 3], [10, 0, 40])
    assert "without a prototype" in notes_of(scene)[0]


def test_what_is_not_part_of_the_picture(build):
    builder = build()
    builder.mesh("/shown")
    builder.mesh("/hidden/m")
    UsdGeom.Imageable(UsdGeom.Xform.Define(builder.stage, "/hidden")).MakeInvisible()
    UsdGeom.Imageable(builder.mesh("/proxy")).CreatePurposeAttr("proxy")
    builder.mesh("/render").CreatePurposeAttr("render")
    builder.mesh("/off").GetPrim().SetActive(False)
    curves = UsdGeom.BasisCurves.Define(builder.stage, "/hair")
    curves.CreatePointsAttr(SQUARE)
    scene = builder.load()
    assert [instance.name for instance in scene.instances] == ["shown", "render"]
    assert "BasisCurves, which are not shown: 1" in " ".join(notes_of(scene))


def test_points_become_spheres(build):
    builder = build(unit=0.01)
    points = UsdGeom.Points.Define(builder.stage, "/p")
    points.CreatePointsAttr([(0, 0, 0), (100, 0, 0)])
    points.CreateWidthsAttr([10.0, 10.0])
    points.CreateDisplayColorPrimvar("vertex").Set([(1, 0, 0), (0, 1, 0)])
    scene = builder.load()
    assert area(scene) == pytest.approx(2 * math.pi * 0.1**2, rel=1e-3)
    assert "spheres of 0.1 m" in notes_of(scene)[0] and scene.meshes[0].colors is not None


def test_time_samples(build):
    builder = build()
    mesh = builder.mesh()
    move = mesh.AddTranslateOp()
    for time in (1.0, 11.0):
        move.Set((time, 0, 0), time)
    assert builder.load().bounds()[0, 0] == pytest.approx(1.0)
    assert builder.load(time=6).bounds()[0, 0] == pytest.approx(6.0)
    shown, seconds, _ = lit_at(builder.path, None, 6, None)  # as gi.render
    assert shown.bounds()[0, 0] == pytest.approx(6.0) and seconds is None
    builder.stage.SetStartTimeCode(5)
    builder.stage.SetEndTimeCode(11)
    scene = builder.load()
    assert scene.bounds()[0, 0] == pytest.approx(5.0) and "time 5 of 5 to 11" in notes_of(scene)[0]


def test_skinned_meshes_are_posed(build):
    """A joint that moves by (0, 2, 0) takes the square with it."""
    builder = build()
    UsdSkel.Root.Define(builder.stage, "/r")
    skeleton = UsdSkel.Skeleton.Define(builder.stage, "/r/s")
    skeleton.CreateJointsAttr(["a"])
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(1)])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(1)])
    animation = UsdSkel.Animation.Define(builder.stage, "/r/s/anim")
    animation.CreateJointsAttr(["a"])
    animation.CreateTranslationsAttr([(0, 2, 0)])
    animation.CreateRotationsAttr([Gf.Quatf(1)])
    animation.CreateScalesAttr([Gf.Vec3h(1)])
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    binding = UsdSkel.BindingAPI.Apply(builder.mesh("/r/m").GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateJointIndicesPrimvar(False, 1).Set([0] * 4)
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * 4)
    np.testing.assert_allclose(builder.load().bounds(), [[0, 2, 0], [1, 3, 0]], atol=1e-6)


# ------------------------------------------------------------------------------------------------ Materials


def test_constants_of_preview_surfaces(build):
    builder = build()
    inputs = {"diffuseColor": (0.1, 0.2, 0.3), "metallic": 0.75, "roughness": 0.25, "emissiveColor": (3.0, 2.0, 1.0)}
    mesh = builder.mesh()
    mesh.CreateDoubleSidedAttr(True)
    builder.material(bind=[mesh], **inputs)
    material = builder.load().materials[0]
    assert material.base_color == pytest.approx((0.1, 0.2, 0.3, 1.0)) and material.double_sided
    assert (material.metallic, material.roughness) == (0.75, 0.25) and material.emission == (3.0, 2.0, 1.0)


@pytest.mark.parametrize(("specular", "metallic", "color"), [(0.04, 0.0, (0.5, 0.4, 0.3)), (0.9, 1.0, (0.9,) * 3)])
def test_constants_of_the_specular_workflow(build, specular, metallic, color):
    """A dielectric reflects the specular colour; a metal has no diffuse one, and the specular one as base colour."""
    builder = build()
    diffuse = (0.5, 0.4, 0.3) if metallic == 0 else (0.0, 0.0, 0.0)
    builder.material(bind=[builder.mesh()], diffuseColor=diffuse, specularColor=(specular,) * 3, useSpecularWorkflow=1)
    scene = builder.load()
    material = scene.materials[0]
    assert material.metallic == pytest.approx(metallic, abs=0.01) and len(notes_of(scene)) == int(metallic)
    assert material.base_color[:3] == pytest.approx(color, abs=0.01)
    expected = (1.5, (1.0, 1.0, 1.0)) if metallic else (0.0, pytest.approx((specular,) * 3))
    assert (material.ior, material.specular_color) == expected


def test_textures_of_the_specular_workflow(build, tmp_path):
    pixels = pictures(tmp_path)
    builder = build()
    texture = builder.texture("/s", "color.png")
    builder.material(bind=[builder.mesh()], specularColor=texture, useSpecularWorkflow=1)
    scene = builder.load()
    material = scene.materials[0]
    assert (material.ior, material.specular_color, notes_of(scene)) == (0.0, (1.0, 1.0, 1.0), [])
    np.testing.assert_array_equal(material.specular_color_texture.image.pixels[..., :3], pixels["color"])


def test_normal_maps_keep_16_bits(build, tmp_path):
    cv = np.full((2, 2), 40_001, np.uint16)
    Image.fromarray(cv).save(tmp_path / "n.png")
    builder = build()
    builder.material(bind=[builder.mesh()], normal=builder.texture("/n", "n.png"))
    assert builder.load().materials[0].normal_texture.image.pixels[0, 0, 0] == 40_001


def test_defaults_and_inputs_of_the_material(build):
    """A surface without values has 0.18 and 0.5; an input of the material gives its value to the shader."""
    builder = build()
    first, second = builder.mesh("/a"), builder.mesh("/b")
    builder.material("/looks/a", bind=[first])
    material = builder.material("/looks/b", bind=[second])
    public = material.CreateInput("tint", Sdf.ValueTypeNames.Color3f)
    public.Set((0.5, 0.25, 0.125))
    surface = UsdShade.Shader(builder.stage.GetPrimAtPath("/looks/b/surface"))
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(public)
    plain, tinted = builder.load().materials
    assert plain.base_color == pytest.approx((0.18, 0.18, 0.18, 1.0)) and plain.roughness == 0.5
    assert tinted.base_color == (0.5, 0.25, 0.125, 1.0)


def pictures(folder):
    rng = np.random.default_rng(0)
    for name, channels in (("color", 3), ("orm", 3), ("alpha", 4)):
        Image.fromarray(rng.integers(0, 256, (4, 8, channels)).astype(np.uint8)).save(folder / f"{name}.png")
    return {name: np.array(Image.open(folder / f"{name}.png")) for name in ("color", "orm", "alpha")}


def test_textures_of_preview_surfaces(build, tmp_path):
    pixels = pictures(tmp_path)
    builder = build()
    mesh = builder.mesh()
    scaled = {"scale": (0.5, 0.25, 1.0, 1.0)}
    builder.material(
        bind=[mesh],
        diffuseColor=builder.texture("/color", "color.png", wrapS="mirror", wrapT="clamp", **scaled),
        roughness=builder.texture("/rough", "orm.png", "g", scale=(1.0, 0.5, 1.0, 1.0), bias=(0.0, 0.25, 0.0, 0.0)),
        metallic=builder.texture("/metal", "orm.png", "b"),
        normal=builder.texture("/normal", "color.png", scale=(2.0, -2.0, 2.0, 1.0), bias=(-1.0, 1.0, -1.0, 0.0)),
        emissiveColor=builder.texture("/glow", "color.png", scale=(7.0, 7.0, 7.0, 1.0)),
    )
    scene = builder.load()
    material = scene.materials[0]
    base = material.base_color_texture
    np.testing.assert_array_equal(base.image.pixels[..., :3], pixels["color"])
    assert material.base_color == (0.5, 0.25, 1.0, 1.0) and (base.wrap_u, base.wrap_v) == ("mirror", "clamp")
    joined = material.metallic_roughness_texture.image.pixels
    np.testing.assert_allclose(joined[..., 1], 0.5 * pixels["orm"][..., 1] + 0.25 * 255, atol=0.51)
    np.testing.assert_array_equal(joined[..., 2], pixels["orm"][..., 2])
    assert (material.roughness, material.metallic) == (1.0, 1.0)
    # The green of this normal map points down.
    np.testing.assert_array_equal(material.normal_texture.image.pixels[..., 1], 255 - pixels["color"][..., 1])
    assert material.emission == (7.0, 7.0, 7.0) and material.normal_scale == 1.0
    assert not notes_of(scene)


def test_raw_colours_and_biases_are_baked(build, tmp_path):
    pixels = pictures(tmp_path)
    builder = build()
    texture = builder.texture("/t", "color.png", sourceColorSpace="raw", bias=(0.1, 0.0, 0.0, 0.0), scale=(0.5,) * 4)
    builder.material(bind=[builder.mesh()], diffuseColor=texture)
    material = builder.load().materials[0]
    linear = linear_from_srgb(material.base_color_texture.image.pixels[..., :3] / 255)
    np.testing.assert_allclose(linear, pixels["color"] / 255 * 0.5 + (0.1, 0, 0), atol=5e-3)


@pytest.mark.parametrize("threshold", [None, 0.25])
def test_opacity_cuts_out(build, tmp_path, threshold):
    pixels = pictures(tmp_path)
    builder = build()
    inputs = {} if threshold is None else {"opacityThreshold": threshold}
    opacity = builder.texture("/o", "alpha.png", "a")
    builder.material(bind=[builder.mesh()], diffuseColor=builder.texture("/c", "color.png"), opacity=opacity, **inputs)
    scene = builder.load()
    material = scene.materials[0]
    assert (material.alpha_mode, material.alpha_cutoff) == (("mask", threshold) if threshold else ("blend", 0.5))
    np.testing.assert_array_equal(material.base_color_texture.image.pixels[..., 3], pixels["alpha"][..., 3])
    assert notes_of(scene) == []


def test_opacity_without_a_threshold_blends(build):
    builder = build()
    builder.material(bind=[builder.mesh()], diffuseColor=(0.1, 0.2, 0.3), opacity=0.25)
    scene = builder.load()
    material = scene.materials[0]
    assert material.alpha_mode == "blend" and notes_of(scene) == []
    np.testing.assert_allclose(material.base_color, (0.1, 0.2, 0.3, 0.25), atol=1e-7)


def test_clear_coats_and_indices_of_refraction(build, tmp_path):
    """Values of textures replace the constants; the roughness of a clear coat is 0.01 unless it is given."""
    pixels = pictures(tmp_path)
    builder = build()
    opacity = builder.texture("/o", "alpha.png", "a")
    builder.material(bind=[builder.mesh()], clearcoat=0.5, clearcoatRoughness=opacity, ior=1.33)
    scene = builder.load()
    material = scene.materials[0]
    assert (material.clearcoat, material.clearcoat_roughness) == (0.5, 1.0)
    assert material.ior == pytest.approx(1.33) and notes_of(scene) == []
    texels = material.clearcoat_roughness_texture.image.pixels[..., 1]
    np.testing.assert_array_equal(texels, pixels["alpha"][..., 3])
    builder = build(suffix=".usdc")
    builder.material(bind=[builder.mesh()], clearcoat=1.0)
    assert builder.load().materials[0].clearcoat_roughness == pytest.approx(0.01)


def test_texture_transforms(build, tmp_path):
    """UsdTransform2d scales, turns and moves (s, t), with t upwards; the chain of two is their product."""
    pictures(tmp_path)
    builder = build()
    reader = builder.reader("/r", "st")
    kinds = [{"scale": (2.0, 3.0), "rotation": 30.0, "translation": (0.1, 0.2)}, {"translation": (0.5, 0.25)}]
    for k, inputs in enumerate(kinds):
        node = builder.shader(f"/t{k}", "UsdTransform2d", **{"in": reader}, **inputs)
        reader = node.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    builder.material(bind=[builder.mesh()], diffuseColor=builder.texture("/c", "color.png", st=reader))
    texture = builder.load().materials[0].base_color_texture
    s, t = 0.3, 0.8
    angle = math.radians(30)
    turned = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]) @ (2 * s, 3 * t)
    expected = turned + np.array((0.6, 0.45))
    # KHR_texture_transform on (s, 1 - t).
    c, sine = math.cos(texture.rotation), math.sin(texture.rotation)
    u, v = np.array(texture.scale) * (s, 1 - t)
    down = np.array([c * u + sine * v, -sine * u + c * v]) + texture.offset
    np.testing.assert_allclose((down[0], 1 - down[1]), expected, atol=1e-12)


def test_two_sets_of_texture_coordinates(build, tmp_path):
    pictures(tmp_path)
    builder = build()
    mesh = builder.mesh()
    for k, name in enumerate(("first", "second")):
        builder.primvar(mesh, name, [(0.25 * k, 0)] * 4, "vertex")
    color = builder.texture("/c", "color.png", st=builder.reader("/r1", "first"))
    glow = builder.texture("/g", "color.png", st=builder.reader("/r2", "second"))
    builder.material(bind=[mesh], diffuseColor=color, emissiveColor=glow)
    found = builder.load().meshes[0]
    slots = found.materials[0].base_color_texture, found.materials[0].emission_texture
    assert [slot.texcoord for slot in slots] == [0, 1]
    assert (found.texcoords0[0, 0], found.texcoords1[0, 0]) == (0.0, 0.25)


def test_vertex_colours_of_materials(build):
    builder = build()
    mesh = builder.mesh()
    mesh.CreateDisplayColorPrimvar("vertex").Set([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
    node = builder.shader("/r", "UsdPrimvarReader_float3", varname="displayColor")
    builder.material(bind=[mesh], diffuseColor=node.CreateOutput("result", Sdf.ValueTypeNames.Float3))
    found = builder.load().meshes[0]
    np.testing.assert_allclose(found.colors[:, :3], [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
    assert found.materials[0].base_color == (1, 1, 1, 1)


@pytest.mark.parametrize(
    ("file", "words"),
    [("none.png", "does not exist"), ("../outside.png", "outside the folders"), ("broken.png", "cannot be used"),
     ("a.<UDIM>.png", "UDIM")],
)  # fmt: skip
def test_unusable_textures_cost_themselves(tmp_path, file, words):
    (tmp_path / "scene").mkdir()
    Image.fromarray(np.zeros((2, 2, 3), np.uint8)).save(tmp_path / "outside.png")
    (tmp_path / "scene" / "broken.png").write_bytes(b"nothing")
    builder = Builder(tmp_path / "scene")
    builder.material(bind=[builder.mesh()], diffuseColor=builder.texture("/t", file))
    scene = builder.load()
    assert scene.materials[0].base_color_texture is None and words in notes_of(scene)[0]


def test_textures_beside_the_folders_of_the_layers(tmp_path):
    """A model, its materials and its textures often have a folder each."""
    for name in ("models", "looks", "textures"):
        (tmp_path / name).mkdir()
    Image.fromarray(np.full((2, 2, 3), 100, np.uint8)).save(tmp_path / "textures" / "t.png")
    looks = Builder(tmp_path / "looks")
    material = looks.material(diffuseColor=looks.texture("/looks/a/t", "../textures/t.png"))
    looks.stage.SetDefaultPrim(material.GetPrim())
    looks.stage.GetRootLayer().Save()
    builder = Builder(tmp_path / "models")
    UsdShade.Material.Define(builder.stage, "/red").GetPrim().GetReferences().AddReference("../looks/s.usda")
    mesh = builder.mesh()
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(UsdShade.Material(builder.stage.GetPrimAtPath("/red")))
    scene = builder.load()
    assert scene.materials[0].base_color_texture.image.pixels[0, 0, 0] == 100 and not notes_of(scene)


def test_other_shaders_are_noted(build):
    builder = build()
    mesh = builder.mesh()
    mesh.CreateDisplayColorAttr([(0.1, 0.2, 0.3)])
    material = builder.material(bind=[mesh])
    UsdShade.Shader(builder.stage.GetPrimAtPath("/looks/a/surface")).CreateIdAttr("GlassShader")
    assert material
    scene = builder.load()
    assert scene.materials[0].base_color == pytest.approx((0.1, 0.2, 0.3, 1.0)) and "GlassShader" in notes_of(scene)[0]


# ------------------------------------------------------------------------------------------------ Lights, cameras


def test_distant_lights(build):
    """E = pi L sin^2(angle / 2); L if normalised, or without an angle."""
    builder = build(up="Z")
    builder.mesh()
    for k, (angle, normalize) in enumerate(((0.53, False), (0.53, True), (0.0, False))):
        light = UsdLux.DistantLight.Define(builder.stage, f"/l{k}")
        light.CreateAngleAttr(angle)
        light.CreateIntensityAttr(10.0)
        light.CreateExposureAttr(2.0)
        light.CreateColorAttr((1.0, 0.5, 0.25))
        light.CreateNormalizeAttr(normalize)
    lights = builder.load().lights
    for light, expected in zip(lights, (40 * math.pi * math.sin(math.radians(0.265)) ** 2, 40.0, 40.0), strict=True):
        assert isinstance(light, DirectionalLight)
        np.testing.assert_allclose(
            np.array(light.color) * light.intensity, np.array([1, 0.5, 0.25]) * expected, rtol=1e-6
        )
        np.testing.assert_allclose(light.direction, [0, -1, 0], atol=1e-12)  # -Z of the stage is down


def test_point_and_spot_lights(build):
    """I = pi r^2 L; a quarter of L if normalised, in the stage's units: I / d^2 is the same in all units."""
    builder = build(unit=0.01)
    builder.mesh()
    for k, normalize in enumerate((False, True)):
        light = UsdLux.SphereLight.Define(builder.stage, f"/l{k}")
        light.CreateRadiusAttr(3.0)
        light.CreateIntensityAttr(100.0)
        light.CreateTreatAsPointAttr(True)
        light.CreateNormalizeAttr(normalize)
        light.AddTranslateOp().Set((0, 100, 0))
    shaping = UsdLux.ShapingAPI.Apply(light.GetPrim())
    shaping.CreateShapingConeAngleAttr(30.0)
    shaping.CreateShapingConeSoftnessAttr(0.5)
    point, spot = builder.load().lights
    assert isinstance(point, PointLight) and isinstance(spot, SpotLight)
    assert point.color[0] * point.intensity == pytest.approx(math.pi * 0.03**2 * 100)
    assert spot.color[0] * spot.intensity == pytest.approx(100 / 4 * 0.01**2)
    assert math.degrees(spot.outer_cone_angle) == pytest.approx(30)
    assert math.degrees(spot.inner_cone_angle) == pytest.approx(15)
    np.testing.assert_allclose(point.position, [0, 1, 0])


@pytest.mark.parametrize(
    ("kind", "sizes", "surface"),
    [("RectLight", {"Width": 2.0, "Height": 3.0}, 6.0), ("DiskLight", {"Radius": 2.0}, 4 * math.pi),
     ("SphereLight", {"Radius": 2.0}, 16 * math.pi), ("CylinderLight", {"Radius": 2.0, "Length": 5.0}, 20 * math.pi)],
)  # fmt: skip
@pytest.mark.parametrize("normalize", [False, True])
def test_area_lights_are_emitters_of_the_exact_power(build, kind, sizes, surface, normalize):
    """Phi = pi L A, with the area in metres; normalised, L is divided by the area in centimetres."""
    builder = build(unit=0.01)
    light = getattr(UsdLux, kind).Define(builder.stage, "/l")
    for name, value in sizes.items():
        getattr(light, f"Create{name}Attr")(value)
    light.CreateIntensityAttr(8.0)
    light.CreateNormalizeAttr(normalize)
    light.AddScaleOp().Set((2, 2, 2))
    scene = builder.load()
    emission = scene.materials[0].emission[0]
    assert emission == pytest.approx(8.0 / (4 * surface if normalize else 1), rel=1e-6)
    assert area(scene) == pytest.approx(4 * surface * 1e-4, rel=1e-6)
    corners = world_triangles(scene)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = (
        faces[:, 2] < 0 if kind in ("RectLight", "DiskLight") else np.einsum("tc,tc->t", faces, corners.mean(1)) > 0
    )
    assert outward.all()


def test_dome_lights(build, tmp_path):
    """Its picture has -Z at the left edge, +X at a quarter; turned by 90 degrees about the vertical, +X at the edge."""
    pixels = np.zeros((8, 16, 3), np.uint8)
    pixels[:, 4] = 255  # towards +X
    Image.fromarray(pixels).save(tmp_path / "sky.png")
    for turn in ("y", "x"):
        builder = build()
        builder.mesh()
        dome = UsdLux.DomeLight.Define(builder.stage, "/d")
        dome.CreateTextureFileAttr("sky.png")
        dome.CreateIntensityAttr(3.0)
        getattr(dome, f"AddRotate{turn.upper()}Op")().Set(90.0)
        environment = builder.load().environment
        assert environment.color == (3.0, 3.0, 3.0)
        if turn == "y":
            # +X of the dome is turned to -Z.
            assert environment.rotation == pytest.approx(math.pi / 2) and environment.image[4, 4, 0] == 1.0
        else:
            # +X stays, +Y of the dome is turned to +Z.
            assert environment.rotation == 0.0 and environment.image[4, 4, 0] > environment.image[4, 8, 0] == 0.0
        builder.path.unlink()
        del builder


def test_cameras(build):
    builder = build(unit=0.01, up="Z")
    builder.mesh()
    camera = UsdGeom.Camera.Define(builder.stage, "/c")
    camera.CreateFocalLengthAttr(35.0)
    camera.CreateVerticalApertureAttr(24.0)
    camera.AddTranslateOp().Set((0, 0, 300))
    camera.AddScaleOp().Set((2, 2, 2))
    flat = UsdGeom.Camera.Define(builder.stage, "/o")
    flat.CreateProjectionAttr("orthographic")
    flat.CreateVerticalApertureAttr(2000.0)
    perspective, orthographic = builder.load().cameras
    assert perspective.yfov == pytest.approx(2 * math.atan(12 / 35))
    np.testing.assert_allclose(perspective.position, [0, 3, 0])
    np.testing.assert_allclose(perspective.world_from_view[:3, 2], [0, 1, 0], atol=1e-12)  # looks down
    assert orthographic.orthographic_height == pytest.approx(2000 / 10 * 0.01)


# ------------------------------------------------------------------------------------------------ Damage

HEAD = "#usda 1.0\n"
BAD = {
    "text.usda": "this is no stage\n",
    "empty.usda": "",
    "unended.usda": HEAD + 'def Mesh "m" {\n',
    "nothing.usda": HEAD,
    "magic.usdc": b"PXR-USDC" + bytes(100),
    "zip.usdz": b"PK\3\4" + bytes(60),
    "no_points.usda": HEAD + 'def Mesh "m" {\n int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 2]\n}\n',
    "counts.usda": HEAD + 'def Mesh "m" {\n point3f[] points = [(0,0,0)]\n int[] faceVertexCounts = [3]\n}\n',
    "wrong_type.usda": HEAD + 'def Mesh "m" {\n string points = "a"\n int[] faceVertexCounts = [3]\n}\n',
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_give_one_sentence(tmp_path, name, capfd):
    content = BAD[name]
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(GiError) as caught:
        load(path)
    assert name in str(caught.value) and "\n" not in str(caught.value) and capfd.readouterr() == ("", "")


def test_wrong_parts_cost_themselves(build, capfd):
    builder = build()
    builder.mesh("/good")
    builder.mesh("/index", ids=[0, 1, 2, 9])
    builder.mesh("/nan", points=[(math.nan, 0, 0), *SQUARE[1:]])
    short = builder.mesh("/short")
    builder.primvar(short, "st", [(0, 0)], "vertex")
    short.CreateNormalsAttr([(0, 0, 1)])
    flat = builder.mesh("/flat")
    flat.AddScaleOp().Set((0, 0, 1))
    builder.stage.DefinePrim("/missing").GetReferences().AddReference("./missing.usda")
    capfd.readouterr()  # what USD says to the writer
    scene = builder.load()
    assert [instance.name for instance in scene.instances] == ["good", "short"]
    words = " ".join(notes_of(scene))
    for expected in ("does not exist", "NaN or infinite", "normals were left out", "scaled to zero", "missing.usda"):
        assert expected in words
    assert capfd.readouterr() == ("", "")
    with pytest.raises(GiError, match="strict"):
        builder.load(strict=True)


def test_instances_are_bounded(build):
    """A few lines make 10^7 prims of instances of instances."""
    builder = build()
    builder.mesh("/p0/m")
    for level in range(1, 8):
        for k in range(10):
            child = builder.stage.DefinePrim(f"/p{level}/c{k}", "Xform")
            child.GetReferences().AddInternalReference(f"/p{level - 1}")
            child.SetInstanceable(True)
    with pytest.raises(GiError, match="unpacks to"):
        builder.load(max_memory=4 << 20)
