"""Tests of the options that every format shares: scale, vertical axis, and motion in place."""

from dataclasses import replace

import made_puppets
import numpy as np
import pytest
from made_bodies import man, random_motion, shape_with_markers

from enliven.document import Character, Project, SkinWeights, graph_shape_from_poses
from enliven.document.character import Pose
from enliven.errors import InputError
from enliven.exporters import sample_performance
from enliven.exporters.placement import ExportPlacement
from enliven.formats.rig.rig import play_clip

Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


@pytest.fixture(scope="module")
def project():
    """Returns a rigged man, a possessed mesh and a puppet, all in motion."""
    random = np.random.default_rng(4)
    shape = shape_with_markers("man", man())
    project, _ = play_clip(Project(), shape, random_motion(random, shape.skeleton, name="walk"))
    pivots = random.normal(size=(3, 3)).astype(np.float32)
    vertices = np.repeat(pivots, 3, 0) + random.normal(size=(9, 3)).astype(np.float32)
    skin = SkinWeights(np.repeat(np.eye(3, 4, dtype=np.uint16), 3, 0), np.full((9, 4), 0.25, np.float32))
    faces = np.arange(9, dtype=np.int32).reshape(-1, 3)
    character = Character("chair", vertices, faces, skin, pivots, np.array([[0, 1], [1, 2]], np.int32))
    poses = [
        Pose(
            "chair", k * 100_000_000, np.tile(np.eye(3, dtype=np.float32), (3, 1, 1)), pivots + np.float32(k)
        )
        for k in range(4)
    ]
    chair, stream = graph_shape_from_poses(character, poses, "sit")
    bean = made_puppets.project()
    project = project.with_takes(*bean.takes.values()).with_streams(stream)
    return project.with_characters(chair, *bean.puppets.values())


def surfaces(performance):
    return np.array(list(performance.surfaces()))


@pytest.mark.parametrize(
    ("name", "how"),
    [("man", "skin"), ("chair", "skin"), ("bean", "skin"), ("bean", "morphs"), ("bean", "points")],
)
def test_scale_and_axis_map_all_points_of_every_rig(project, name, how):
    performance = sample_performance(project, name, 0.0, 0.2, 10.0, how=how)
    placed = ExportPlacement(scale=2.0, up="z").apply_to(performance)
    np.testing.assert_allclose(surfaces(placed), surfaces(performance) @ (2.0 * Z_UP.T), atol=1e-5)
    np.testing.assert_allclose(placed.mesh.vertices, performance.mesh.vertices @ (2.0 * Z_UP.T))
    if performance.joints is not None:
        np.testing.assert_allclose(placed.joints, performance.joints @ (2.0 * Z_UP.T), atol=1e-9)
        assert placed.stretches == performance.stretches


@pytest.mark.parametrize(
    ("name", "how"), [("man", "skin"), ("chair", "skin"), ("bean", "skin"), ("bean", "points")]
)
def test_motion_in_place_keeps_height_and_pose(project, name, how):
    performance = sample_performance(project, name, 0.0, 0.3, 10.0, how=how)
    if performance.places is not None:
        walk = np.linspace(0.0, 2.0, len(performance.times))[:, None]
        performance = replace(performance, places=performance.places + walk * [1.0, 0.1, -1.0])
    before = surfaces(performance)
    after = surfaces(ExportPlacement(in_place=True).apply_to(performance))
    moved = before - after
    np.testing.assert_allclose(moved, np.broadcast_to(moved[:, :1], moved.shape), atol=1e-5)
    np.testing.assert_allclose(moved[0], 0.0, atol=1e-6)
    np.testing.assert_allclose(moved[..., 1], 0.0, atol=1e-6)
    assert np.abs(moved[-1]).max() > 0.01, "something travelled"


def test_in_place_root_stays_where_it_begins(project):
    performance = ExportPlacement(in_place=True).apply_to(sample_performance(project, "man", rate=10.0))
    root = performance.joints[:, 0]
    np.testing.assert_allclose(root[:, [0, 2]], np.tile(root[0, [0, 2]], (len(root), 1)), atol=1e-12)


@pytest.mark.parametrize("options", [{"scale": -1.0}, {"scale": np.inf}, {"up": "x"}])
def test_invalid_placement_is_refused(options):
    with pytest.raises(InputError):
        ExportPlacement(**options)
