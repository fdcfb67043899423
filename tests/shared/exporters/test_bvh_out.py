"""Tests of BVH export: two readers, our own and a plain one, find every joint at its position in every
frame.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document import Clip, GraphCharacter, GraphPart, PoseStream, Project, Skeleton
from enliven.document.rigged import SkinWeights, still_shape
from enliven.errors import InputError
from enliven.exporters import exporter_of, performance_of_clip, sample_performance
from enliven.exporters.bvh import bvh_text
from enliven.formats.motion.bvh import parse_bvh
from enliven.formats.rig.rig import play_clip
from enliven.meshes import Mesh
from enliven.motion_clips.capture_clip import clip_of_capture
from enliven.rotation import multiply, normalized

CLOSE = 1e-4
"""Maximum position error of a BVH file, metres."""


@st.composite
def clips(draw, most=9):
    """Draws a random tree whose bones rotate together at some joints and separately at others. Some have no
    length.
    """
    random = np.random.default_rng(draw(st.integers(0, 10_000)))
    joints, frames = draw(st.integers(1, most)), draw(st.integers(1, 4))
    parents = [-1] + [int(random.integers(0, j)) for j in range(1, joints)]
    at = np.zeros((joints, 3))
    for j in range(joints):
        length = 0.0 if random.random() < 0.15 else random.uniform(0.1, 1.0)
        at[j] = (at[parents[j]] if j else random.normal(size=3)) + length * _direction(random)
    names = tuple(f"joint {j}" if random.random() < 0.3 else f"j{j}" for j in range(joints))
    turns = normalized(random.normal(size=(frames, joints, 4)))
    for j in range(1, joints):
        if random.random() < 0.5:  # the same position as a sibling before it, or as the root
            turns[:, j] = turns[:, next((i for i in range(1, j) if parents[i] == parents[j]), 0)]
    if random.random() < 0.2:  # straight up: two of the three angles share an axis
        turns[:] = [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]
    skeleton = Skeleton(names, np.array(parents, np.int32), at)
    return Clip("clip", skeleton, turns, random.normal(size=(frames, 3)) * 3.0, 1 / 30)


def _direction(random):
    vector = random.normal(size=3)
    return vector / np.linalg.norm(vector)


def joints_of(clip):
    """Returns (F, N, 3) joint positions, computed literally."""
    performance = performance_of_clip(clip)
    places = np.empty((len(clip.turns), len(clip.skeleton), 3))
    for f in range(len(places)):
        for j, parent in enumerate(clip.skeleton.parents):
            at = clip.skeleton.positions[j] - performance.pivots[j]
            places[f, j] = performance.linear[f, j] @ at + performance.positions[f, j]
            assert j == 0 or np.allclose(performance.positions[f, j], places[f, parent], atol=1e-9)
    return places


def obvious(text):
    """Returns names, parents and (F, N, 3) positions of a BVH file, read word by word, one frame and joint at
    a time.
    """
    words = text[: text.index("MOTION")].split()
    rows = [[float(w) for w in line.split()] for line in text[text.index("Frame Time:") :].splitlines()[1:]]
    names, parents, offsets, channels, open_ = [], [], [], [], []
    for n, word in enumerate(words):
        if word in ("ROOT", "JOINT", "End"):
            parents.append(open_[-1] if open_ else -1)
            names.append(words[n + 1] if word != "End" else f"{names[parents[-1]]} end")
            channels.append([])
            offsets.append(None)
        elif word == "{":
            open_.append(len(names) - 1)
        elif word == "}":
            open_.pop()
        elif word == "OFFSET":
            offsets[open_[-1]] = np.array([float(w) for w in words[n + 1 : n + 4]])
        elif word == "CHANNELS":
            channels[open_[-1]] = words[n + 2 : n + 2 + int(words[n + 1])]
    places = np.empty((len(rows), len(names), 3))
    for f, row in enumerate(rows):
        left, world = list(row), []
        for j, kinds in enumerate(channels):
            local = np.eye(4)
            local[:3, 3] = offsets[j]
            for kind in kinds:
                axis, value = "XYZ".index(kind[0]), left.pop(0)
                step = np.eye(4)
                if kind.endswith("position"):
                    step[axis, 3] = value
                else:
                    a, b = [k for k in range(3) if k != axis]
                    sine = np.sin(np.radians(value)) * (-1 if axis == 1 else 1)
                    step[a, a] = step[b, b] = np.cos(np.radians(value))
                    step[b, a], step[a, b] = sine, -sine
                local = local @ step
            world.append(local if parents[j] < 0 else world[parents[j]] @ local)
            places[f, j] = world[j][:3, 3]
        assert not left
    return names, parents, places


def check_places(clip, names, places, scale=1.0):
    """Checks joint positions. Inner joints are found by name, the ends of limbs among the end sites."""
    expected, skeleton = joints_of(clip), clip.skeleton
    ends = [n for n, name in enumerate(names) if name.endswith(" end")]
    for j, name in enumerate(skeleton.names):
        called = name.replace(" ", "_")
        if called in names:
            actual = places[:, names.index(called)] * scale
        else:
            assert not skeleton.children[j]
            near = [np.abs(places[:, n] * scale - expected[:, j]).max() for n in ends]
            actual = places[:, ends[int(np.argmin(near))]] * scale
        assert np.abs(actual - expected[:, j]).max() < CLOSE


@settings(max_examples=60, deadline=None)
@given(clips(), st.sampled_from(["m", "cm"]))
def test_joint_positions_survive_in_two_readers(clip, unit):
    text = bvh_text(performance_of_clip(clip), unit)
    scale = {"m": 1.0, "cm": 0.01}[unit]
    names, parents, places = obvious(text)
    check_places(clip, names, places, scale)
    ours = parse_bvh(text)
    check_places(clip, list(ours.names), ours.positions, scale)
    assert ours.notes == () and ours.parents == tuple(parents)
    assert ours.seconds == pytest.approx(clip.step)
    # Strict readers take either joints or one end site below a joint.
    for n in range(len(names)):
        below = [names[m] for m in range(len(names)) if parents[m] == n]
        assert len(below) == 1 or not any(name.endswith(" end") for name in below)


@settings(max_examples=20, deadline=None)
@given(clips())
def test_a_file_that_is_read_and_written_again_has_the_same_hierarchy(clip):
    once = parse_bvh(bvh_text(performance_of_clip(clip)))
    read = clip_of_capture(once, "again", rest="zero", unit="m")
    again = parse_bvh(bvh_text(performance_of_clip(read)))
    if once.names[1:] and len(read.skeleton) == len(
        once.names
    ):  # a root that only carries another is left out
        assert again.parents == once.parents
        assert np.abs(again.positions - once.positions).max() < CLOSE


def test_angles_do_not_jump_between_frames():
    skeleton = Skeleton(("a", "b"), np.array([-1, 0]), np.array([[0.0, 0, 0], [0, 1, 0]]))
    spin = np.radians(np.arange(0, 720, 10)) / 2
    turns = np.stack([np.cos(spin), 0 * spin, np.sin(spin), 0 * spin], 1)[:, None].repeat(2, 1)
    text = bvh_text(performance_of_clip(Clip("spin", skeleton, turns, np.zeros((72, 3)), 0.1)))
    rows = np.array([line.split() for line in text.splitlines() if line.count(" ") == 5][1:], float)
    assert np.abs(np.diff(rows[:, 3:], axis=0)).max() < 10.1


def test_rigged_shape_is_baked_with_its_motion(tmp_path):
    at = np.array([[0, 1, 0], [0.2, 1, 0], [0.2, 0, 0], [-0.2, 1, 0.1], [-0.2, 0, 0.1]], float)
    skeleton = Skeleton(("hips", "left hip", "left foot", "right hip", "right foot"), [-1, 0, 1, 0, 3], at)
    random = np.random.default_rng(4)
    turns = np.tile(normalized(random.normal(size=(1, 5, 4))), (6, 1, 1))
    turns[1:] = multiply(turns[1:], normalized([1, 0, 0, 0] + 0.1 * random.normal(size=(5, 5, 4))))
    clip = Clip("walk", skeleton, turns, random.normal(size=(6, 3)), 0.1)
    project, _ = play_clip(Project(), still_shape("man", skeleton), clip)
    performance = sample_performance(project, "man", 0.1, 0.4, 10.0)
    path = tmp_path / "man.bvh"
    exporter_of(path, unit="cm").write(path, [performance], "man", unit="cm")
    names, _, places = obvious(path.read_text())
    for frame in range(4):
        for joint in (1, 3):
            expected = performance.positions[frame, joint + 1]
            assert (
                np.abs(
                    places[frame, names.index(skeleton.names[joint].replace(" ", "_"))] / 100 - expected
                ).max()
                < CLOSE
            )


def test_content_unsupported_by_bvh_is_reported():
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.array([1, 0, 0, 0], np.float32), (3, 1)))
    stream = PoseStream("dance", np.tile(np.eye(3), (2, 1, 1, 1)), np.zeros((2, 1, 3)), 0.1)
    graph = GraphCharacter(
        "chair", np.zeros((1, 3)), np.zeros((0, 2)), mesh, skin, (GraphPart("dance", [0]),)
    )
    performance = sample_performance(Project().with_streams(stream).with_characters(graph), "chair")
    with pytest.raises(InputError, match=r"no skeleton.*Export a \.glb file instead"):
        bvh_text(performance)
    with pytest.raises(InputError, match="only one character, but 2"):
        exporter_of("a.bvh").write("a.bvh", [performance, performance], "two")
    skeleton = Skeleton(("a",), np.array([-1]), np.zeros((1, 3)))
    with pytest.raises(InputError, match="the unit 'inch' is unknown"):
        bvh_text(
            performance_of_clip(Clip("a", skeleton, np.array([[[1, 0, 0, 0]]]), np.zeros((1, 3)), 0.1)),
            "inch",
        )
