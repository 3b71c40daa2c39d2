"""Scenes of Python objects: arrays, meshes, trimesh meshes and scenes; what their users are told."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
import trimesh
from PIL import Image as Pillow
from trimesh.scene import lighting
from trimesh.visual.material import MultiMaterial, PBRMaterial, SimpleMaterial

import wgpu_gi as gi
from wgpu_gi.pictures.color import linear_from_srgb
from wgpu_gi.scene.load import lit, read_scene

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def placed(scene: gi.Scene, k: int = 0) -> np.ndarray:
    """Return the world positions of an instance."""
    instance = scene.instances[k]
    matrix = np.asarray(instance.world_from_local)
    return instance.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]


# ------------------------------------------------------------------------------------------------ Arrays


def test_arrays_keep_positions_far_from_the_origin():
    scene = gi.Scene.from_arrays(SQUARE + 1e6, TWO, name="square")
    assert np.array_equal(placed(scene), SQUARE + 1e6) and scene.triangle_count == 2
    assert scene.instances[0].mesh.materials[0].base_color == (0.8, 0.8, 0.8, 1.0) and scene.name == "square"


def test_lists_quads_and_normals():
    scene = gi.Scene.from_arrays(SQUARE.tolist(), [[0, 1, 2, 3]], normals=[[0, 0, 5]] * 4, uvs=SQUARE[:, :2])
    mesh = scene.instances[0].mesh
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]] and mesh.normals.tolist() == [[0, 0, 1]] * 4
    assert np.array_equal(mesh.texcoords0, SQUARE[:, :2])


@pytest.mark.parametrize("colors", [(1.0, 0.5, 0.0), [[1, 0.5, 0]] * 4, np.tile(np.float32([1, 0.5, 0, 1]), (4, 1))])
def test_float_colors_are_linear(colors):
    mesh = gi.Scene.from_arrays(SQUARE, TWO, colors=colors).instances[0].mesh
    np.testing.assert_allclose(mesh.colors, [[1, 0.5, 0, 1]] * 4)
    assert mesh.materials[0].base_color == (1.0, 1.0, 1.0, 1.0)


@pytest.mark.parametrize("kind", [list, np.uint8, np.int64])
def test_whole_colors_are_srgb(kind):
    colors = [255, 128, 0] if kind is list else np.array([255, 128, 0], kind)
    mesh = gi.Scene.from_arrays(SQUARE, TWO, colors=colors).instances[0].mesh
    np.testing.assert_allclose(mesh.colors[0], [1, linear_from_srgb(128 / 255), 0, 1], rtol=1e-6)


def test_zeros_and_ones_mean_the_same_in_both_scales():
    mesh = gi.Scene.from_arrays(SQUARE, TWO, colors=(1, 0, 0)).instances[0].mesh
    assert mesh.colors[0].tolist() == [1, 0, 0, 1]


def test_colors_of_faces():
    mesh = gi.Scene.from_arrays(SQUARE, TWO, colors=[[1.0, 0, 0], [0, 0, 1.0]]).instances[0].mesh
    assert mesh.colors[mesh.triangles].reshape(2, 3, 4).tolist() == [[[1, 0, 0, 1]] * 3, [[0, 0, 1, 1]] * 3]
    quads = gi.Scene.from_arrays(SQUARE, [[0, 1, 2, 3]], colors=[[0, 1.0, 0]]).instances[0].mesh
    assert quads.colors.tolist() == [[0, 1, 0, 1]] * 6


def test_flat_faces_are_left_out_with_a_note():
    scene = gi.Scene.from_arrays(SQUARE, [*TWO.tolist(), [0, 0, 1]])
    assert scene.triangle_count == 2 and scene.notes == ["1 faces without area were left out"]


# ------------------------------------------------------------------------------------------------ Light and warnings


def test_objects_without_light_get_a_sky_and_a_warning():
    for source in ((SQUARE, TWO), trimesh.creation.box(), gi.Scene.from_arrays(SQUARE, TWO).instances[0].mesh):
        with pytest.warns(gi.GiWarning, match="an overcast sky was added") as caught:
            scene = gi.load(source)
        assert len(caught) == 1 and caught[0].filename == __file__
        assert scene.environment.color == (1, 1, 1) and [camera.name for camera in scene.cameras]


def test_lights_that_are_given_need_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = gi.load((SQUARE, TWO), lights=[gi.PointLight((0, 0, 3))])
        assert scene.environment is None and len(scene.lights) == 1
        assert gi.load((SQUARE, TWO), environment="0.5,0.5,1").environment.color == (0.5, 0.5, 1.0)


def test_each_note_is_one_warning(tmp_path):
    (tmp_path / "a.obj").write_text("mtllib none.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.warns(gi.GiWarning) as caught:
        scene = gi.load(tmp_path / "a.obj")
    assert len(caught) == 2 and "none.mtl" in str(caught[0].message)
    assert len(scene.notes) == 3 and "camera" in scene.notes[2]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_scene(tmp_path / "a.obj")  # for the command line, which prints notes


def test_a_repaired_sky_is_a_warning(tmp_path):
    picture = np.ones((4, 8, 3), np.float32)
    picture[1, 2] = np.nan
    gi.save_image(tmp_path / "sky.exr", {"radiance": picture})
    with pytest.warns(gi.GiWarning, match="NaN") as caught:
        sky = gi.load_environment(tmp_path / "sky.exr")
    assert sky.image.shape == (4, 8, 3) and caught[0].filename == __file__
    with pytest.warns(gi.GiWarning, match="NaN"):
        assert gi.load("cornell", environment=tmp_path / "sky.exr").environment.image.shape == (4, 8, 3)


def test_a_scene_with_light_is_rendered_itself_and_one_without_is_copied():
    scene = gi.Scene.from_arrays(SQUARE, TWO)
    copied, notes = lit(scene)
    assert copied is not scene and copied.instances[0] is scene.instances[0] and len(notes) == 1
    assert scene.environment is None and scene.notes == [] and scene.cameras == []
    scene.lights.append(gi.PointLight((0, 0, 2)))
    assert lit(scene) == (scene, [])
    sky = gi.Environment((0, 0, 0))
    lighted, notes = lit(scene, sky)
    assert lighted.environment is sky and scene.environment is None and notes == []


# ------------------------------------------------------------------------------------------------ trimesh


def test_a_box_stays_flat_and_a_mesh_with_normals_smooth():
    box = trimesh.creation.box(extents=(1, 2, 3))
    mesh = read_scene(box).instances[0].mesh
    assert mesh.normals is None and len(mesh.triangles) == 12
    smooth = trimesh.Trimesh(SQUARE, TWO, vertex_normals=[[0, 0, 1]] * 4, process=False)
    assert read_scene(smooth).instances[0].mesh.normals.tolist() == [[0, 0, 1]] * 4


def test_colors_of_vertices_and_faces():
    box = trimesh.creation.box()
    box.visual.vertex_colors = np.tile(np.uint8([255, 128, 0, 255]), (8, 1))
    mesh = read_scene(box).instances[0].mesh
    np.testing.assert_allclose(mesh.colors[0], [1, linear_from_srgb(128 / 255), 0, 1], rtol=1e-6)
    box.visual.face_colors = np.uint8([[k * 20, 0, 0, 255] for k in range(12)])
    mesh = read_scene(box).instances[0].mesh
    np.testing.assert_allclose(
        mesh.colors[mesh.triangles][:, :, 0], np.tile(linear_from_srgb(np.arange(12) * 20 / 255.0), (3, 1)).T, rtol=1e-6
    )


def test_transparent_colors_are_noted():
    box = trimesh.creation.box()
    box.visual.vertex_colors = [255, 0, 0, 100]
    assert "transparency of its colours is ignored" in read_scene(box).notes[0]


def test_a_pbr_material():
    texture = Pillow.new("RGB", (2, 2), (255, 0, 0))
    texture.putpixel((0, 0), (0, 255, 0))
    material = PBRMaterial(
        name="tiles",
        baseColorFactor=[1.0, 0.5, 0.25, 1.0],
        metallicFactor=0.3,
        emissiveFactor=[0, 1, 2],
        baseColorTexture=texture,
        alphaMode="MASK",
        alphaCutoff=0.4,
        doubleSided=True,
    )
    visual = trimesh.visual.TextureVisuals(uv=SQUARE[:, :2] * (0.25, 1), material=material)
    mesh = read_scene(trimesh.Trimesh(SQUARE, TWO, visual=visual, process=False)).instances[0].mesh
    found = mesh.materials[0]
    assert (found.name, found.metallic, found.roughness) == ("tiles", 0.3, 1.0)
    np.testing.assert_allclose(found.base_color, [1, 0.5, 0.25, 1], atol=1 / 255)
    assert (found.emission, found.double_sided) == ((0, 1, 2), True)
    assert (found.alpha_mode, found.alpha_cutoff) == ("mask", 0.4)
    material.alphaMode = "BLEND"
    mesh = read_scene(trimesh.Trimesh(SQUARE, TWO, visual=visual, process=False)).instances[0].mesh
    assert (mesh.materials[0].alpha_mode, mesh.materials[0].alpha_cutoff) == ("blend", 0.5)
    # v points up in trimesh and down in glTF: (0, 1) there is the top left texel, which is green.
    np.testing.assert_allclose(mesh.texcoords0, [[0, 1], [0.25, 1], [0.25, 0], [0, 0]])
    assert found.base_color_texture.image.pixels[0, 0].tolist() == [0, 255, 0, 255]


def test_a_simple_material():
    visual = trimesh.visual.TextureVisuals(uv=SQUARE[:, :2], material=SimpleMaterial(diffuse=[255, 51, 0, 255]))
    found = read_scene(trimesh.Trimesh(SQUARE, TWO, visual=visual, process=False)).materials[0]
    np.testing.assert_allclose(found.base_color, [1, 0.2, 0, 1])
    assert (found.metallic, found.roughness) == (0, 1)
    # With an image and no colour, the image is not darkened.
    image = SimpleMaterial(image=Pillow.new("RGB", (1, 1), (10, 20, 30)))
    visual = trimesh.visual.TextureVisuals(uv=SQUARE[:, :2], material=image)
    found = read_scene(trimesh.Trimesh(SQUARE, TWO, visual=visual, process=False)).materials[0]
    assert found.base_color == (1, 1, 1, 1) and found.base_color_texture.image.pixels.tolist() == [[[10, 20, 30, 255]]]


def test_several_materials():
    both = MultiMaterial([SimpleMaterial(diffuse=[255, 0, 0, 255]), SimpleMaterial(diffuse=[0, 255, 0, 255])])
    visual = trimesh.visual.TextureVisuals(uv=SQUARE[:, :2], material=both, face_materials=[1, 0])
    mesh = read_scene(trimesh.Trimesh(SQUARE, TWO, visual=visual, process=False)).instances[0].mesh
    assert mesh.material_of_triangle.tolist() == [1, 0]
    assert [m.base_color[:2] for m in mesh.materials] == [(1, 0), (0, 1)]


def turned(degrees: float, offset: tuple[float, float, float]) -> np.ndarray:
    """Return a rotation about +Y and a translation, (4, 4)."""
    matrix = trimesh.transformations.rotation_matrix(math.radians(degrees), [0, 1, 0])
    matrix[:3, 3] = offset
    return matrix


def test_a_scene_with_its_graph_lights_and_camera():
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box(), geom_name="box", node_name="left", transform=turned(0, (-2, 0, 0)))
    scene.graph.update("right", "left", matrix=turned(90, (4, 0, 0)), geometry="box")
    scene.add_geometry(trimesh.Trimesh(), geom_name="nothing")
    scene.add_geometry(trimesh.load_path(SQUARE[:, :2]), geom_name="outline")
    scene.add_geometry(trimesh.creation.box(), geom_name="flat", transform=np.diag([1, 1, 0, 1.0]))
    scene.lights = [
        lighting.PointLight(name="bulb", color=[255, 0, 0, 255], intensity=3.0),
        lighting.SpotLight(name="spot", intensity=2.0, innerConeAngle=0.1, outerConeAngle=0.5),
        lighting.DirectionalLight(name="sun", intensity=5.0),
    ]
    scene.graph["bulb"], scene.graph["spot"], scene.graph["sun"] = (
        turned(0, (0, 3, 0)),
        turned(90, (1, 2, 3)),
        np.eye(4),
    )
    scene.camera = trimesh.scene.Camera(fov=(60, 40), name="eye")
    scene.camera_transform = turned(0, (0, 0, 8))
    found = read_scene(scene)

    # One mesh, two instances.
    assert [i.name for i in found.instances] == ["left", "right"] and len(found.meshes) == 1
    np.testing.assert_allclose(found.instances[1].world_from_local, turned(90, (2, 0, 0)), atol=1e-12)
    # Parts that cannot be shown.
    notes = " ".join(found.notes)
    assert len(found.notes) == 3, notes
    assert all(word in notes for word in ("'nothing'", "'outline'", "scales it to zero")), notes
    # Lights and camera.
    bulb, spot, sun = found.lights
    assert (bulb.position, bulb.intensity, bulb.color) == ((0, 3, 0), 3, (1, 0, 0))
    np.testing.assert_allclose(spot.direction, (-1, 0, 0), atol=1e-12)
    assert (spot.inner_cone_angle, spot.outer_cone_angle) == (0.1, 0.5) and sun.direction == (0, 0, -1)
    (camera,) = found.cameras
    assert (camera.name, camera.position.tolist()) == ("eye", [0, 0, 8])
    assert camera.yfov == pytest.approx(math.radians(40))


def test_a_scene_whose_lights_were_not_given_gets_the_sky():
    """trimesh makes up lights and a camera when asked for them."""
    found = read_scene(trimesh.Scene(trimesh.creation.box()))
    assert found.lights == [] and found.environment.name == "default sky"


def test_a_point_cloud():
    colors = np.uint8([[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 255]])
    found = read_scene(trimesh.PointCloud(SQUARE, colors=colors), point_size=0.5)
    mesh = found.instances[0].mesh
    assert "4 points" in found.notes[0] and len(mesh.positions) % 4 == 0
    np.testing.assert_allclose(mesh.colors[0], [1, 0, 0, 1])
    np.testing.assert_allclose(np.ptp(placed(found), axis=0), (1.5, 1.5, 0.5), rtol=0.1)
    assert read_scene(trimesh.Scene([trimesh.PointCloud(SQUARE)])).triangle_count > 4


def test_nothing_to_show():
    with pytest.raises(gi.GiError, match="nothing to show"):
        read_scene(trimesh.Scene())
    with pytest.raises(gi.GiError, match="no faces"):
        read_scene(trimesh.Trimesh())
    with pytest.raises(gi.GiError, match="a trimesh mesh, point cloud or scene can be shown, not a Path2D"):
        read_scene(trimesh.load_path(SQUARE[:, :2]))


def test_damaged_parts_are_refused_if_strict():
    scene = trimesh.Scene([trimesh.creation.box(), trimesh.Trimesh()])
    assert read_scene(scene).triangle_count == 12
    with pytest.raises(gi.GiError, match="damage is refused"):
        gi.load(scene, strict=True)
