"""Tests that characters from the store move exactly like freshly prepared ones."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from enliven.character_store import store
from enliven.document import Pose
from enliven.errors import EnlivenError
from enliven.formats.project.one_character import character_bytes, project_of_mesh
from enliven.meshes import save_mesh
from enliven.person import Body, J
from enliven.possession import Actor, ActorSettings, make_standing_figure
from enliven.samples.shipped import load_sample
from enliven.wire import PutCharacter
from enliven_edge.settings import EdgeSettings
from enliven_edge.stage import character_setup
from enliven_edge.stage.character_setup import create_actor
from enliven_edge.uploaded_actor import create_uploaded_actor

STEP_NS = 33_333_333


@pytest.fixture
def folder(tmp_path: Path, monkeypatch) -> Iterator[Path]:
    """Returns an empty store, which is used instead of the user's."""
    monkeypatch.setenv(store.FOLDER_VARIABLE, str(tmp_path / "store"))
    return tmp_path / "store"


def count_graphs(monkeypatch) -> list[str]:
    """Returns a list to which the name of each new deformation graph is added."""
    names: list[str] = []
    build = character_setup.DeformationGraph.build

    def counted(mesh, **options):
        names.append(mesh.name)
        return build(mesh, **options)

    monkeypatch.setattr(character_setup.DeformationGraph, "build", counted)
    return names


def play(actor: Actor, seed: int) -> list[Pose]:
    """Returns the poses of a character while a person approaches, is attached, moves and leaves."""
    noise = np.random.default_rng(seed)
    joints = make_standing_figure() + noise.normal(scale=0.2, size=3) * (1.0, 0.0, 1.0)
    poses = []
    for number in range(20):
        joints = joints + noise.normal(scale=0.02, size=(J, 3))
        body = Body(3, joints, np.ones(J))
        if number == 5:
            try:
                actor.possess(body)
            except EnlivenError as error:
                assert "reach" in str(error)
        if number == 15 and actor.holds:
            actor.release()
        poses.append(actor.perform([body], number * STEP_NS))
    return poses


def assert_same_bits(one: list[Pose], other: list[Pose]) -> None:
    for before, after in zip(one, other, strict=True):
        assert before.linear.tobytes() == after.linear.tobytes()
        assert before.positions.tobytes() == after.positions.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    "own",
    [ActorSettings(), ActorSettings(how="mapped"), ActorSettings(how="beside", place="fixed")],
    ids=["inside", "mapped", "fixed"],
)
def test_stored_mesh_moves_like_a_fresh_one(
    folder: Path, tmp_path: Path, monkeypatch, own: ActorSettings
) -> None:
    path = tmp_path / "lamp.obj"
    save_mesh(load_sample("lamp"), path)
    fresh = create_actor(str(path), 32, own)
    graphs = count_graphs(monkeypatch)
    stored = create_actor(str(path), 32, own)
    monkeypatch.setenv(store.FOLDER_VARIABLE, "off")
    without_store = create_actor(str(path), 32, own)
    assert graphs == ["lamp"], "only the last one was prepared again"
    assert fresh.size == stored.size and fresh.settings == stored.settings
    seeds = np.random.default_rng(11).integers(0, 2**32, 3)
    for seed in map(int, seeds):
        moved = play(fresh, seed)
        assert_same_bits(moved, play(stored, seed))
        assert_same_bits(moved, play(without_store, seed))


@pytest.mark.slow
def test_other_settings_and_other_meshes_are_prepared(folder: Path, tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "lamp.obj"
    save_mesh(load_sample("lamp"), path)
    graphs = count_graphs(monkeypatch)
    create_actor(str(path), 24)
    create_actor(str(path), 24)
    assert len(graphs) == 1
    create_actor(str(path), 25)
    create_actor(str(path), 24, ActorSettings(height_ratio=1.5))
    create_actor(str(path), 24, up="z")
    create_actor(str(path), 24, name="other")
    assert len(graphs) == 5
    path.write_text(path.read_text() + "# changed\n")
    create_actor(str(path), 24)
    assert len(graphs) == 6
    assert len(list(folder.iterdir())) == 6


@pytest.mark.slow
def test_restored_upload_is_read_from_the_store(folder: Path, monkeypatch) -> None:
    graphs = count_graphs(monkeypatch)
    data = character_bytes(project_of_mesh(load_sample("lamp"), "lamp"), "lamp")
    order = PutCharacter("lamp", 1, hashlib.sha256(data).digest(), len(data), True)
    fresh = create_uploaded_actor(data, order, EdgeSettings(nodes=24))
    stored = create_uploaded_actor(data, order, EdgeSettings(nodes=24))
    assert len(graphs) == 1
    assert_same_bits(play(fresh, 5), play(stored, 5))


def test_wrong_mesh_is_refused_each_time(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "horse.obj"
    for _ in range(2):
        with pytest.raises(EnlivenError, match=r"horse\.obj"):
            create_actor(str(path))
    path.write_text("no mesh\n")
    for _ in range(2):
        with pytest.raises(EnlivenError, match=r"horse\.obj"):
            create_actor(str(path))
    assert not folder.exists()
