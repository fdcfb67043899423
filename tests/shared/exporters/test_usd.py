"""Tests of USD files: valid, and read back by UsdSkelSkinningQuery with enliven's own vertices."""

import sys
import zipfile
from dataclasses import replace

import made_puppets
import numpy as np
import pytest
from gltf_builder import random_rig
from made_bodies import man, random_motion, shape_with_markers
from test_gltf_write import random_clip, random_shape
from test_materials import BUMPS, WOOD, made_file

from enliven.cli import run
from enliven.document import Project
from enliven.errors import InputError, ResourceError
from enliven.exporters import exporter_of, sample_performance
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip

pxr = pytest.importorskip("pxr", reason="usd-core is not installed (the extra 'usd')")

from pxr import Gf, Usd, UsdGeom, UsdShade, UsdSkel  # noqa: E402
from usd_reader import validation_errors, vertices_at  # noqa: E402

SAME = 2e-6
"""Maximum difference of a vertex as a fraction of the size. File and poses contain float32."""
HALF = 1e-3
"""Maximum difference if bones are stretched, as a fraction of the size. USD stores scales as float16 (11
bits).
"""
KINDS = ("usda", "usdc", "usdz")


@pytest.fixture(scope="module")
def walk():
    shape = shape_with_markers("man", man())
    return play_clip(Project(), shape, random_motion(np.random.default_rng(1), shape.skeleton, name="walk"))[
        0
    ]


def saved(path, *performances, **options):
    exporter_of(path, **options).save(path, performances, path.stem, **options)
    assert validation_errors(path) == []
    return Usd.Stage.Open(str(path))


def check_vertices(path, name, performance, scale=1.0, tolerance=SAME):
    frames = list(performance.surfaces())
    size = np.ptp(performance.mesh.vertices, axis=0).max()
    for number in {0, 1, len(frames) // 2, len(frames) - 1} & set(range(len(frames))):
        read = vertices_at(path, name, float(number)) / scale
        assert np.abs(read - frames[number]).max() < tolerance * size


@pytest.mark.parametrize("kind", KINDS)
def test_skeleton_is_valid_and_moves_the_surface_alike(walk, tmp_path, kind):
    path, performance = tmp_path / f"walk.{kind}", sample_performance(walk, "man", rate=20.0)
    stage = saved(path, performance)
    check_vertices(path, "man", performance)
    assert stage.GetTimeCodesPerSecond() == 20.0 and stage.GetEndTimeCode() == len(performance.times) - 1
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0 and UsdGeom.GetStageUpAxis(stage) == "Y"
    skeleton = UsdSkel.Skeleton.Get(stage, "/walk/man/Skeleton")
    joints, rest = skeleton.GetJointsAttr().Get(), skeleton.GetRestTransformsAttr().Get()
    assert len(joints) == len(rest) == len(skeleton.GetBindTransformsAttr().Get())
    animation = UsdSkel.Animation.Get(stage, "/walk/man/Skeleton/Animation")
    assert list(animation.GetJointsAttr().Get()) == list(joints)
    assert [tuple(scale) for scale in animation.GetScalesAttr().Get(0.0)] == [(1.0, 1.0, 1.0)] * len(joints)


@pytest.mark.parametrize("seed", range(5))
def test_random_skeletons_move_alike(tmp_path, seed):
    random = np.random.default_rng(seed)
    shape = random_shape(random, "squid")
    project, _ = play_clip(Project(), shape, random_clip(random, shape.skeleton))
    path, performance = tmp_path / "squid.usdc", sample_performance(project, "squid", rate=20.0)
    saved(path, performance)
    check_vertices(path, "squid", performance)


@pytest.mark.parametrize("seed", range(3))
def test_stretched_bones_lose_only_the_last_digits_of_scales(tmp_path, seed):
    rig = read_gltf(random_rig(seed, tmp_path / "stretched.gltf", stretched=0.0))
    project, shape = play_clip(Project(), rig.shape, rig.clips[0])
    performance = replace(sample_performance(project, shape.id, rate=1.0 / rig.clips[0].step), name="rig")
    path = tmp_path / "stretched.usdc"
    saved(path, performance)
    assert performance.stretches
    check_vertices(path, "rig", performance, tolerance=HALF)


def test_puppets_are_points_over_time_without_error(tmp_path):
    path, exporter = tmp_path / "bean.usdc", exporter_of(tmp_path / "bean.usdc")
    how = exporter.representation()
    performance = sample_performance(made_puppets.project(), "bean", 0.0, 0.5, 10.0, how=how)
    stage = saved(path, performance)
    assert performance.error is None
    check_vertices(path, "bean", performance)
    points = UsdGeom.Mesh.Get(stage, "/bean/bean/Mesh").GetPointsAttr()
    assert points.GetTimeSamples() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_unit_axis_and_scale_are_stated_and_applied(walk, tmp_path):
    path, performance = tmp_path / "walk.usda", sample_performance(walk, "man", rate=20.0)
    stage = saved(path, performance, unit="cm", up="z", scale=2.0)
    assert UsdGeom.GetStageMetersPerUnit(stage) == 0.01 and UsdGeom.GetStageUpAxis(stage) == "Z"
    surface = list(performance.surfaces())[2] @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    read = vertices_at(path, "man", 2.0)
    np.testing.assert_allclose(read, 200.0 * surface, atol=2e-3)


def test_several_characters_with_one_name_and_odd_names(walk, tmp_path):
    performance = sample_performance(walk, "man", 0.0, 0.2, 10.0)
    names = ("man", "man", "1 ?", "Ärmel", "Materials")
    path = tmp_path / "2 of them.usda"
    stage = saved(path, *(replace(performance, name=name) for name in names))
    children = [prim.GetName() for prim in stage.GetDefaultPrim().GetChildren()]
    assert sorted(children) == sorted(["man", "man_2", "_1__", "Ärmel", "Materials", "Materials_2"])
    check_vertices(path, "man_2", performance)


@pytest.mark.parametrize("kind", KINDS)
def test_materials_and_images_are_kept(tmp_path, kind):
    made_file(tmp_path / "square.glb")
    shape = read_gltf(tmp_path / "square.glb").shape
    path = tmp_path / f"tile.{kind}"
    performance = sample_performance(Project().with_characters(shape), shape.id)
    stage = saved(path, performance)
    if kind == "usdz":
        with zipfile.ZipFile(path) as package:
            images = [package.read(name) for name in package.namelist() if "texture" in name]
    else:
        images = [image.read_bytes() for image in (tmp_path / "tile_textures").iterdir()]
    assert sorted(images) == sorted([WOOD, BUMPS])
    mesh = UsdGeom.Mesh.Get(stage, f"/tile/{shape.id}/Mesh")
    subsets = UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
    assert sorted(i for subset in subsets for i in subset.GetIndicesAttr().Get()) == [0, 1, 2]
    oak = UsdShade.Shader.Get(stage, "/tile/Materials/oak/surface")
    base = UsdShade.Shader(oak.GetInput("diffuseColor").GetConnectedSource()[0])
    assert base.GetInput("scale").Get() == Gf.Vec4f(0.9, 0.8, 0.7, 1.0)
    assert base.GetInput("file").Get().resolvedPath and base.GetInput("sourceColorSpace").Get() == "sRGB"
    glass = UsdShade.Shader.Get(stage, "/tile/Materials/glass/surface")
    assert glass.GetInput("opacityThreshold").Get() == pytest.approx(0.3)
    assert glass.GetInput("roughness").Get() == pytest.approx(0.1)
    # Texture coordinates give the same position in the image. USD counts from its bottom.
    own = shape.mesh.materials
    read = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").ComputeFlattened()).reshape(-1, 3, 2)
    np.testing.assert_allclose(read * [1, -1] + [0, 1], own.uvs[:, :, 0], atol=1e-6)


def test_transform_of_texture_coordinates_gives_the_same_place(tmp_path):
    turn, scale, offset = 0.4, (2.0, 3.0), (0.1, -0.2)
    extension = {"scale": list(scale), "offset": list(offset), "rotation": turn}
    texture = {"index": 0, "extensions": {"KHR_texture_transform": extension}}
    moved = {"name": "moved", "pbrMetallicRoughness": {"baseColorTexture": texture}}
    made_file(tmp_path / "square.glb", materials=(moved, {"name": "other"}))
    shape = read_gltf(tmp_path / "square.glb").shape
    stage = saved(tmp_path / "tile.usda", sample_performance(Project().with_characters(shape), shape.id))
    node = UsdShade.Shader.Get(stage, "/tile/Materials/moved/base_transform")
    angle = np.radians(node.GetInput("rotation").Get())
    spin = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    uv = np.array([0.3, 0.7])
    st = np.array([uv[0], 1.0 - uv[1]])
    result = spin @ (st * node.GetInput("scale").Get()) + node.GetInput("translation").Get()
    c, s = np.cos(turn), np.sin(turn)
    expected = np.array([[c, s], [-s, c]]) @ (uv * scale) + offset
    np.testing.assert_allclose([result[0], 1.0 - result[1]], expected, atol=1e-6)


def test_vertex_colours_are_linear(walk, tmp_path):
    shape = random_shape(np.random.default_rng(3), "squid")
    stage = saved(tmp_path / "a.usdc", sample_performance(Project().with_characters(shape), "squid"))
    mesh = UsdGeom.Mesh.Get(stage, "/a/squid/Mesh")
    colours = np.array(mesh.GetDisplayColorAttr().Get())
    coded = shape.mesh.colours / 255.0
    expected = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(colours, expected, atol=1e-6)
    assert mesh.GetDisplayColorPrimvar().GetInterpolation() == "vertex"


@pytest.mark.parametrize("kind", KINDS)
def test_interrupted_export_leaves_the_older_files(tmp_path, kind):
    made_file(tmp_path / "square.glb")
    shape = read_gltf(tmp_path / "square.glb").shape
    performance = sample_performance(Project().with_characters(shape), shape.id)
    path = tmp_path / f"tile.{kind}"
    saved(path, performance)
    before = {each: each.read_bytes() for each in tmp_path.rglob("*") if each.is_file()}

    def interrupt(share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        exporter_of(path).save(path, [performance], "tile", progress=interrupt)
    assert {each: each.read_bytes() for each in tmp_path.rglob("*") if each.is_file()} == before


def test_unwritable_usd_is_reported(walk, tmp_path, monkeypatch):
    performance = sample_performance(walk, "man", 0.0, 0.1)
    path = tmp_path / "out.usda"
    with pytest.raises(InputError, match="no character was selected"):
        exporter_of(path).save(path, [], "out")
    with pytest.raises(InputError, match="the unit 'inch' is unknown"):
        exporter_of(path, unit="inch")
    with pytest.raises(InputError, match="has no mesh"):
        exporter_of(path).save(path, [replace(performance, mesh=None)], "out")
    monkeypatch.setattr("shutil.copyfile", full)
    with pytest.raises(ResourceError, match="No space left"):
        exporter_of(path).save(path, [performance], "out")
    assert not list(tmp_path.iterdir())


def full(*_):
    raise OSError(28, "No space left on device")


def test_missing_library_names_the_command_to_install(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ResourceError, match=r'pip install "enliven\[usd\]"'):
        exporter_of(tmp_path / "out.usda")
    assert run(["export", "no.mcap", "-o", str(tmp_path / "out.usdz")]) == 4
    assert "usd-core, which is not installed. Install it: pip install" in capsys.readouterr().err


def test_the_command_writes_all_kinds(walk, tmp_path, capsys):
    source = tmp_path / "man.glb"
    exporter_of(source).save(source, [sample_performance(walk, "man", rate=10.0)], "man")
    for kind in KINDS:
        assert run(["export", str(source), "-o", str(tmp_path / f"man.{kind}"), "--in-place"]) == 0
        assert validation_errors(tmp_path / f"man.{kind}") == []
    assert "contains 0.70 s of motion of man" in capsys.readouterr().out
