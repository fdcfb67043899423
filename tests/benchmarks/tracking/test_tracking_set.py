"""Tests of the set of tracking sequences: its coverage, its splits, and its use without recorded motions."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
import tracking_cache
import tracking_scene
from tracking_kept import OPENED, SEALED, SEALED_CONFIDENCE, SEALED_DECEMBER, SEALED_FLOOR, SEALED_TURNS
from tracking_scene import Sequence
from tracking_seated import SittingDown, lowest_point
from tracking_set import CLOSE, FLOOR, HELD_OUT, TUNING, TURNS, sequences

from enliven.camera import world_from_level_camera
from enliven.person import Joint
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.sensor.profile import load_profile


@pytest.mark.parametrize(
    ("seen", "kept"),
    [
        (TUNING, HELD_OUT),
        (CLOSE, OPENED),
        (TUNING, OPENED),
        (TUNING, SEALED),
        (HELD_OUT, SEALED),
        (CLOSE, SEALED),
        (OPENED, SEALED),
        (TURNS, SEALED_TURNS),
        (TUNING, SEALED_TURNS),
        (TURNS, SEALED_FLOOR),
        (FLOOR, SEALED_FLOOR),
        (SEALED_TURNS, SEALED_FLOOR),
        (TURNS, SEALED_DECEMBER),
        (FLOOR, SEALED_DECEMBER),
        (SEALED_FLOOR, SEALED_DECEMBER),
        (TURNS, SEALED_CONFIDENCE),
        (FLOOR, SEALED_CONFIDENCE),
        (SEALED_DECEMBER, SEALED_CONFIDENCE),
    ],
)
def test_names_are_unique_and_splits_share_no_scene(seen: str, kept: str) -> None:
    names = [s.name for s in sequences()]
    assert len(set(names)) == len(names)
    moves = {
        split: {move for s in sequences(split) for p in s.people for _, move, _, _ in p.moves}
        for split in (seen, kept)
    }
    shared = moves[seen] & moves[kept]
    assert not shared, shared
    builds = {split: {p.build for s in sequences(split) for p in s.people} for split in (seen, kept)}
    assert not builds[seen] & builds[kept]


@pytest.mark.parametrize("split", [TUNING, HELD_OUT])
def test_every_difficulty_exists_without_recorded_motions(split: str, monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(tracking_scene, "DATA", tmp_path)
    listed = sequences(split)
    words = " ".join(s.name for s in listed)
    for needed in (
        "still", "overhead", "crouch", "kneel", "floor", "turn", "one leg", "side", "cross", "touch",
        "recover", "dropped", "slowed", "out of order", "frozen", "holed", "knocked", "joined",
    ):  # fmt: skip
        assert needed in words, needed
    assert {s.kind for s in listed} == {"accuracy", "still", "recovery", "trouble"}
    assert max(len(s.people) for s in listed) >= 3


@pytest.mark.slow
def test_everyone_comes_into_view_and_stays_on_the_floor() -> None:
    for sequence in sequences():
        if sequence.kind == "recovery" or sequence.trouble not in ("", "knocked"):
            continue  # scenes and postures of other sequences
        profile = load_profile(sequence.profile)
        mount = world_from_level_camera(sequence.height, np.radians(sequence.tilt))
        camera_from_world, camera_width = np.linalg.inv(mount), profile.camera.width / profile.camera.fx
        for p, person in enumerate(q.appearance() for q in sequence.people):
            times = np.linspace(0, sequence.seconds, 8)
            figures = [f for f in (person.figure(t) for t in times) if f is not None]
            joints = np.stack([f.joints for f in figures])
            camera = joints @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
            wide = np.abs(camera[..., 0] / camera[..., 2]) < 0.6 * camera_width
            assert (wide & (camera[..., 2] > 0.5)).mean() > 0.3, (sequence.name, p)
            assert joints[..., 1].min() > -0.12, (sequence.name, p)


@pytest.mark.parametrize("build", [Proportions(1.4), Proportions(1.75), Proportions(1.95, legs=1.05)])
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_sitting_person_rests_on_the_floor_without_sinking_in(build, seed):
    performer = Performer(build)
    motion = SittingDown(performer, seed)
    for time in np.linspace(0.0, motion.duration, 25):
        figure = motion.figure(time)
        assert lowest_point(performer, figure) == pytest.approx(0.0, abs=1e-3), time
        assert figure.joints[:, 1].min() > 0.0, time
    assert figure.joints[Joint.HIP_CENTER, 1] < 0.25 * build.height


def test_frames_and_truth_survive_the_cache(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(tracking_cache, "CACHE", tmp_path)
    still = sequences(TUNING, "still")[0]
    short = Sequence("short", TUNING, still.people, 0.2, "tof", covered=(0.05, 0.12))
    first = tracking_cache.rendered(short)
    reread = tracking_cache.rendered(short)
    assert len(first) == 6 and len(list(tmp_path.glob("*.mcap"))) == 1
    for (a, m), (b, n) in zip(first, reread, strict=True):
        np.testing.assert_array_equal(a.depth, b.depth)
        np.testing.assert_array_equal(m.joints, n.joints)
    frame, truth = short.ensemble().frame(3)
    np.testing.assert_array_equal(first[3][0].depth, frame.depth)
    np.testing.assert_array_equal(first[3][1].visible, truth.visible)
    dark = [not f.depth.any() for f, _ in tracking_cache.delivered(short)]
    assert dark == [False, False, True, True, False, False]
