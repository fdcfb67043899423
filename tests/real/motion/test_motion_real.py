"""Tests of real takes on synthetic non-human chains, with captures of six conventions and Kinect walks."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from enliven.document.clip import Clip
from enliven.document.project import Project
from enliven.document.rigged import still_shape
from enliven.document.skeleton import Skeleton
from enliven.formats.motion.bvh import read_bvh
from enliven.formats.motion.expmap import read_expmap
from enliven.motion.contact.pin import pin_feet
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.retarget import bind_chain, extend_to_leaf, set_travel
from enliven.motion_clips.capture_clip import clip_of_capture
from enliven.motion_clips.clip_sampling import trim_clip
from enliven.motion_clips.joint_positions import clip_of_bodies
from enliven.person import BODY_NAMES
from enliven.person.joints import Joint
from enliven.rotation import IDENTITY, conjugate, multiply, rotate
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.registry import find_files, find_reader

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data"))
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]
FILES = sorted(DATA.glob("bvh/*/*.bvh")) + sorted(DATA.glob("cmu_expmap/t*.txt"))
WALKS = [
    p for p in FILES if p.stem in ("02_01", "neutral_01_000", "test_walking_1", "dataset-1_walk_normal_001")
]


def clip_of(path: Path) -> Clip:
    capture = read_bvh(path) if path.suffix == ".bvh" else read_expmap(path)
    return trim_clip(clip_of_capture(capture, "take"), 0.0, 6.0)


def joints_of(clip: Clip) -> np.ndarray:
    """Returns the (F, N, 3) joint positions of a take."""
    at = np.empty((len(clip.turns), len(clip.skeleton), 3))
    at[:, 0] = clip.root
    for j, parent in enumerate(clip.skeleton.parents):
        if parent >= 0:
            at[:, j] = at[:, parent] + rotate(clip.turns[:, j], clip.skeleton.vectors[j])
    return at


def tentacle(joints: int) -> Skeleton:
    """Returns a slightly curved polyline that hangs down."""
    u = np.linspace(0.0, 1.0, joints)
    at = np.stack([0.1 * np.sin(4 * u), 1.5 - 1.2 * u, 0.1 * u], 1)
    return Skeleton(tuple(f"node {i}" for i in range(joints)), np.arange(-1, joints - 1, dtype=np.int32), at)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Returns the largest angle between rotations (..., 4), radians."""
    return float(
        4 * np.arcsin(min(np.minimum(*(np.linalg.norm(a + s * b, axis=-1) for s in (1, -1))).max() / 2, 1))
    )


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem[-24:])
def test_a_capture_is_a_person_in_metres_that_stands_on_the_floor(path: Path) -> None:
    clip = clip_of(path)
    at = joints_of(clip)
    assert 1.2 < np.ptp(clip.skeleton.positions[:, 1]) < 1.9
    assert 0.75 < clip.skeleton.positions[0, 1] - clip.skeleton.positions[:, 1].min() < 1.0
    assert abs(np.percentile(at[:, :, 1].min(1), 20)) < 0.12
    assert (np.abs(np.diff(clip.turns, axis=0)).max(-1) < 1.0).all()  # no quaternion changes its sign


@pytest.mark.parametrize("path", FILES[::3], ids=lambda path: path.stem[-24:])
@pytest.mark.parametrize("joints", [3, 14])
def test_a_tentacle_turns_in_all_as_the_limb_does(path: Path, joints: int) -> None:
    clip = clip_of(path)
    end = next(
        i for i, name in enumerate(clip.skeleton.names) if name.lower().endswith(("hand", "wrist", "hand_l"))
    )
    limb = clip.skeleton.path(0, end)
    shape = still_shape("tentacle", tentacle(joints))
    project = bind_chain(
        Project().with_takes(clip).with_characters(shape),
        "tentacle",
        range(joints),
        "take",
        limb,
        basis=IDENTITY,
    )
    turns, at = Player(project, "tentacle").sample(np.arange(len(clip.turns)) * clip.step)
    wanted = multiply(conjugate(clip.turns[:, 0]), clip.turns[:, end])
    assert angle(turns[:, -1], wanted) < 1e-6
    lengths = np.linalg.norm(np.diff(at, axis=1), axis=-1)
    np.testing.assert_allclose(lengths, np.tile(shape.skeleton.lengths[1:], (len(at), 1)), rtol=1e-9)
    # Nothing jumps more than the person does, because each bone has a part of the limb's rotation.
    ours, theirs = (np.abs(np.diff(q, axis=0)).max() for q in (turns[:, -1], clip.turns))
    assert ours < 3 * theirs + 0.05


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem[-24:])
def test_a_person_on_its_own_skeleton_is_itself(path: Path) -> None:
    clip = clip_of(path)
    skeleton = clip.skeleton
    project = Project().with_takes(clip).with_characters(still_shape("twin", skeleton))
    project = bind_chain(project, "twin", (0,), "take", (0,))
    free = set(range(1, len(skeleton)))
    for start in range(len(skeleton)):
        for child in skeleton.children[start]:
            if child in free:
                chain = (start, *extend_to_leaf(skeleton, child))
                project = bind_chain(project, "twin", chain, "take", chain)
                free -= set(chain)
    assert not free
    project = set_travel(project, "twin", "take")
    times = np.arange(0, len(clip.turns), 7) * clip.step
    joints = Player(project, "twin").sample(times)[1]
    np.testing.assert_allclose(joints, joints_of(clip)[::7], atol=1e-6)


def legs_of(skeleton: Skeleton) -> list[tuple[int, int, int]]:
    """Returns hip, knee and ankle of both sides."""
    names = [name.lower() for name in skeleton.names]
    legs = []
    for ankle in (i for i, name in enumerate(names) if name.endswith(("foot", "foot_l", "foot_r", "ankle"))):
        knee = int(skeleton.parents[ankle])
        legs.append((int(skeleton.parents[knee]), knee, ankle))
    return legs


@pytest.mark.parametrize("path", WALKS, ids=lambda path: path.stem)
def test_a_walk_on_shorter_legs_stands_on_its_feet(path: Path) -> None:
    clip = clip_of(path)
    skeleton = clip.skeleton
    legs = legs_of(skeleton)
    assert len(legs) == 2
    # The skeleton has the same bones, and legs three quarters as long, which would slide.
    positions = skeleton.positions.copy()
    for joint in range(1, len(skeleton)):
        shrunk = any(joint in leg[1:] for leg in legs)
        link = skeleton.vectors[joint] * (0.75 if shrunk else 1.0)
        positions[joint] = positions[skeleton.parents[joint]] + link
    shape = still_shape("short", Skeleton(skeleton.names, skeleton.parents, positions))
    project = bind_chain(Project().with_takes(clip).with_characters(shape), "short", (0,), "take", (0,))
    for hip, _, ankle in legs:
        chain = skeleton.path(0, hip) if hip else (0,)
        chain = (*chain[:-1], *skeleton.path(hip, ankle), *extend_to_leaf(skeleton, ankle)[1:])
        project = bind_chain(project, "short", chain, "take", chain, basis=IDENTITY)
    project = set_travel(project, "short", "take", scale=1.0)
    pinned = Player(pin_feet(project, "short", [leg[2] for leg in legs]), "short")
    free, times = Player(project, "short"), np.arange(0, clip.duration, 1 / 60)
    before, after = free.sample(times)[1], pinned.sample(times)[1]
    stood = 0
    for _, _, ankle in legs:
        contacts = pinned.contacts()[skeleton.names[ankle]]
        for a, b, place in zip(contacts.starts, contacts.ends, contacts.places, strict=True):
            inside = (times >= a) & (times <= b)
            if inside.sum() < 6:
                continue
            stood += 1
            ours, theirs = (np.abs(at[inside, ankle] - place).max() for at in (after, before))
            assert ours < 0.02 + 0.3 * theirs
    assert stood >= 2


@pytest.mark.parametrize("name", ["Person001_1", "Person030_2"])
def test_a_walk_before_a_kinect_drives_a_tentacle(name: str) -> None:
    paths = find_files([str(DATA / f"skeletons/kinect_gait/{name}.txt")])
    frames = list(find_reader(paths).read(paths, ImportOptions()))[:300]
    bodies = [frame.bodies[0] for frame in frames if frame.bodies]
    times = np.array([frame.time_ns for frame in frames if frame.bodies]) * 1e-9
    clip = clip_of_bodies(bodies, times, "take")
    assert clip.skeleton.names == BODY_NAMES and clip.duration == pytest.approx(
        times[-1] - times[0], abs=0.04
    )
    # Every bone has the direction that the sensor measured.
    at = joints_of(clip)
    seconds = times - times[0]
    for joint in (Joint.KNEE_LEFT, Joint.ELBOW_RIGHT, Joint.HEAD):
        parent = clip.skeleton.parents[joint]
        for i in range(0, len(bodies), 25):
            frame = round(seconds[i] / clip.step)
            ours = at[frame, joint] - at[frame, parent]
            theirs = bodies[i].joints[joint] - bodies[i].joints[parent]
            cosine = ours @ theirs / np.linalg.norm(ours) / np.linalg.norm(theirs)
            assert cosine > 0.9 or bodies[i].confidence[joint] == 0
    limb = clip.skeleton.path(Joint.HIP_LEFT, Joint.FOOT_LEFT)
    project = Project().with_takes(clip).with_characters(still_shape("tentacle", tentacle(9)))
    project = bind_chain(project, "tentacle", range(9), "take", limb)
    part = trim_clip(clip, 1.0, 3.0)
    moved = Player(project, "tentacle").sample(1.0 + np.arange(len(part.turns)) * clip.step)[1]
    assert np.isfinite(moved).all() and np.ptp(moved[:, -1], axis=0).max() > 0.05
