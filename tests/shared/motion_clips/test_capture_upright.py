"""Tests that an imported motion capture is upright and in metres, whatever the axes, unit and skeleton of the
file.
"""

import numpy as np
import pytest
from person_bvh import UP, format_bvh, generate_motion

from enliven.motion_clips.take_files import read_take
from enliven.rotation import rotate


def joints_of(clip) -> dict[str, np.ndarray]:
    """Returns (F, 3) positions of each joint by name."""
    rest, parents = clip.skeleton.positions, clip.skeleton.parents
    at = [clip.root]
    for j in range(1, len(parents)):
        at.append(at[parents[j]] + rotate(clip.turns[:, j], rest[j] - rest[parents[j]]))
    return dict(zip(clip.skeleton.names, at, strict=True))


@pytest.fixture(scope="module")
def wanted(tmp_path_factory):
    path = tmp_path_factory.mktemp("twin") / "twin.bvh"
    path.write_text(format_bvh(*generate_motion()))
    return read_take(path)[0]


def check(tmp_path, wanted, same_turns=True, **how):
    path = tmp_path / "a.bvh"
    path.write_text(format_bvh(*generate_motion(), **how))
    clip, notes = read_take(path)
    assert clip.skeleton.names[-20:] == wanted.skeleton.names[-20:]
    actual, twin = joints_of(clip), joints_of(wanted)
    for name, at in twin.items():
        np.testing.assert_allclose(actual[name], at, atol=2e-4)
    if same_turns:
        np.testing.assert_allclose(clip.skeleton.positions, wanted.skeleton.positions, atol=2e-4)
    return notes


@pytest.mark.parametrize("unit", [1.0, 0.01, 0.0254, 0.001])
@pytest.mark.parametrize("up", list(UP))
def test_every_axis_and_unit_give_the_clip_of_the_twin(tmp_path, wanted, up, unit):
    notes = check(tmp_path, wanted, axes=UP[up], unit=unit)
    assert notes == (
        () if up == "+Y" else (f"the {up} axis of the file points up, so the motion was turned upright",)
    )


@pytest.mark.parametrize("up", ["+Z", "-Z", "+X", "-Y"])
def test_a_root_with_an_extra_rotation_is_upright(tmp_path, wanted, up):
    # The skeleton is written with +Y up, and the root rotates the motion to another up axis.
    check(tmp_path, wanted, same_turns=False, extra=UP[up])
    # The skeleton is written with another up axis, and the root rotates it to +Y.
    check(tmp_path, wanted, same_turns=False, axes=UP[up], extra=UP[up].T)


@pytest.mark.parametrize("up", ["+Y", "+Z"])
def test_a_joint_that_carries_the_hips_is_upright(tmp_path, wanted, up):
    check(tmp_path, wanted, same_turns=False, axes=UP["+Z"], carrier=UP[up])


def lying(height: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns a person face up on a floor, with the head towards -Z and the hips at 1 m along Z."""
    root, turns = generate_motion()
    turns = turns.copy()
    turns[:, 0] = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]) @ turns[:, 0]
    return np.tile([0.0, height, 3.0], (len(root), 1)), turns


def test_a_person_who_lies_all_the_time_stays_on_the_floor(tmp_path):
    path = tmp_path / "lying.bvh"
    path.write_text(format_bvh(*lying(0.1)))
    clip, notes = read_take(path)
    assert notes == ()
    at = np.stack(list(joints_of(clip).values()))
    assert np.ptp(at[..., 1]) < 0.7 and np.ptp(at[..., 2]) > 1.2


def test_an_animal_of_other_names_stands_on_its_legs(tmp_path):
    """The animal is like a table with four legs and paws. It has neither head nor knees by our joint
    names.
    """
    legs = "".join(
        f"JOINT Thigh{k}\n{{\nOFFSET {x} {y} 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nJOINT Hock{k}\n{{\n"
        f"OFFSET 0 0 -30\nCHANNELS 3 Zrotation Xrotation Yrotation\nJOINT Paw{k}\n{{\nOFFSET 0 2 -30\n"
        "CHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 5 0\n}\n}\n}\n}\n"
        for k, (x, y) in enumerate([(10, 40), (-10, 40), (10, -40), (-10, -40)])
    )
    head = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    row = " ".join(["0 0 62", *["0 0 0"] * 13])
    path = tmp_path / "dog.bvh"
    path.write_text(
        f"HIERARCHY\nROOT Body\n{{\nOFFSET 0 0 0\n{head}\n{legs}}}\nMOTION\nFrames: 2\nFrame Time: .04\n{row}\n{row}\n"  # noqa: E501
    )
    clip, notes = read_take(path)
    assert notes == ("the +Z axis of the file points up, so the motion was turned upright",)
    paws = [at[:, 1].mean() for name, at in joints_of(clip).items() if name.startswith("Paw")]
    assert max(paws) < 0.1 < clip.root[0, 1]
