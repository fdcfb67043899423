"""Tests of puppets from files: missing parts are reported with advice before the stage opens."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sample_meshes.cactus_puppet import TAKE, cactus_project

from enliven.cli import run
from enliven.document.project import Project
from enliven.document.puppet import ControlPoint
from enliven.errors import InputError
from enliven.example_sessions.text import write_session
from enliven.formats.project.file import write_project
from enliven.meshes.mesh import Mesh
from enliven_edge.stage.puppet.puppet_setup import create_puppet_actor
from enliven_edge.stage.puppet.spec import is_puppet

CACTUS = cactus_project(0.05)
PUPPET = CACTUS.puppet("cactus")


def written(path: Path, project: Project) -> str:
    write_project(path, project)
    return str(path)


def with_puppet(**changes: object) -> Project:
    return CACTUS.with_characters(PUPPET.with_changes(**changes))


def test_puppet_names_are_recognised() -> None:
    assert all(
        is_puppet(name) for name in ("cactus", "a/b.toml", "show.enliven", "show.enliven#Bob", "x.TOML")
    )
    assert not any(is_puppet(name) for name in ("chair", "cactus.obj", "toml", "a#b.obj"))


def test_generated_cactus_session_and_project_give_equal_puppets(tmp_path: Path) -> None:
    session = tmp_path / "show.toml"
    write_session(session, CACTUS, "cactus")
    actors = [
        create_puppet_actor(spec)
        for spec in ("cactus", str(session), written(tmp_path / "p.enliven", CACTUS))
    ]
    assert {len(actor.character.pivots) for actor in actors} == {1 + len(PUPPET.points)}
    assert {actor.character.id for actor in actors} >= {"cactus"}
    for actor in actors[1:]:
        assert actor.character.held is not None
        np.testing.assert_array_equal(actor.character.held, [point.vertex for point in PUPPET.points])
        np.testing.assert_allclose(actor._examples.targets, actors[1]._examples.targets, atol=1e-3)


def test_one_of_several_puppets_must_be_named(tmp_path: Path) -> None:
    both = CACTUS.with_characters(PUPPET.with_changes(id="Bob"))
    spec = written(tmp_path / "two.enliven", both)
    with pytest.raises(InputError, match="2 puppets") as caught:
        create_puppet_actor(spec)
    assert "#cactus" in str(caught.value)
    assert create_puppet_actor(f"{spec}#Bob").character.id == "Bob"
    with pytest.raises(InputError, match="no puppet 'Eve'"):
        create_puppet_actor(f"{spec}#Eve")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"poses": PUPPET.poses[:1]}, "Pose one more"),
        ({"poses": ()}, "Pose two examples"),
        ({"points": (), "poses": ()}, "Put control points on the mesh"),
        ({"points": (replace(PUPPET.points[0], joint=""), *PUPPET.points[1:])}, "Pair 'head' with a joint"),
        ({"points": (replace(PUPPET.points[0], joint="antenna"), *PUPPET.points[1:])}, "antenna"),
        ({"poses": (PUPPET.poses[0], PUPPET.poses[0])}, "same pose"),
    ],
)
def test_incomplete_puppet_reports_missing_parts(
    tmp_path: Path, changes: dict[str, object], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        create_puppet_actor(written(tmp_path / "p.enliven", with_puppet(**changes)))


def test_a_project_without_a_puppet_and_a_file_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the project has no puppet"):
        create_puppet_actor(written(tmp_path / "p.enliven", Project().with_takes(CACTUS.takes[TAKE])))
    with pytest.raises(InputError, match="the file does not exist"):
        create_puppet_actor(str(tmp_path / "gone.toml"))
    (tmp_path / "odd.toml").write_text("[mesh\n")
    with pytest.raises(InputError, match="TOML"):
        create_puppet_actor(str(tmp_path / "odd.toml"))


@pytest.mark.slow
def test_mesh_too_large_for_viewers_is_reported_at_once(tmp_path: Path) -> None:
    count = 2_000_100
    vertices = np.zeros((count, 3))
    vertices[:, 0] = np.arange(count) * 1e-6
    vertices[:4] = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    mesh = Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    points = tuple(ControlPoint(str(k), k, ("ankle left", "wrist left", "ankle right")[k]) for k in range(3))
    poses = tuple(replace(pose, places=pose.places[:3]) for pose in (PUPPET.poses[0], PUPPET.poses[-1]))
    huge = PUPPET.with_changes(mesh=mesh, points=points, poses=poses, symmetry=None)
    with pytest.raises(InputError, match="Simplify the mesh"):
        create_puppet_actor(written(tmp_path / "p.enliven", CACTUS.with_characters(huge)))


def test_edge_reports_missing_key_pose_before_listening(tmp_path: Path, capfd) -> None:
    spec = written(tmp_path / "p.enliven", with_puppet(poses=PUPPET.poses[:1]))
    assert run(["edge", "--mesh", spec, "--port", "0"]) != 0
    output = capfd.readouterr().err
    assert "Pose one more" in " ".join(output.split())
    assert "listens" not in output
