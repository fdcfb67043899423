"""Tests of exponential maps: rotations survive, the wrong order of the root's angles is corrected, errors
name lines.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from enliven.errors import InputError
from enliven.formats.motion.expmap import COLUMNS, read_expmap


def table(root: Rotation, others: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Returns (117,) a row of the file. The maps are those of the inverse rotations."""
    return np.concatenate([place, -root.as_rotvec(), -others.ravel()])


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(st.floats(-179, 179), st.floats(-80, 80), st.floats(-80, 80), st.integers(0, 1000))
def test_the_roots_angles_come_back(tmp_path_factory, z: float, y: float, x: float, seed: int) -> None:
    """Angles Z, Y, X that were composed as Z, X, Y are composed as Z, Y, X."""
    others = np.random.default_rng(seed).normal(0, 0.5, (37, 3))
    wrong = Rotation.from_euler("ZXY", [z, x, y], degrees=True)
    path = tmp_path_factory.mktemp("maps") / "a.txt"
    np.savetxt(path, table(wrong, others, np.array([1.0, 17.0, 2.0]))[None], delimiter=",", fmt="%.12g")
    capture = read_expmap(path)
    right = Rotation.from_euler("ZYX", [z, y, x], degrees=True).as_matrix()
    np.testing.assert_allclose(capture.rotations[0, 0], right, atol=1e-7)
    np.testing.assert_allclose(
        read_expmap(path, repairs_root=False).rotations[0, 0], wrong.as_matrix(), atol=1e-9
    )
    np.testing.assert_allclose(capture.positions[0, 0], [1.0, 17.0, 2.0])
    # A joint hangs on its parent by the offset, turned as the parent is.
    for joint in range(1, 38):
        parent = capture.parents[joint]
        local = capture.rotations[0, parent].T @ (capture.positions[0, joint] - capture.positions[0, parent])
        straight = read_rest(path).positions[0]
        np.testing.assert_allclose(local, straight[joint] - straight[parent], atol=1e-6)
        turn = capture.rotations[0, parent].T @ capture.rotations[0, joint]
        np.testing.assert_allclose(turn, Rotation.from_rotvec(others[joint - 1]).as_matrix(), atol=1e-7)


def read_rest(path: Path):
    """Reads a skeleton with zero rotations."""
    rest = path.with_name("rest.txt")
    if not rest.exists():
        rest.write_text(",".join(["0"] * COLUMNS) + "\n")
    return read_expmap(rest)


def test_the_rest_pose_is_a_person(tmp_path) -> None:
    capture = read_rest(tmp_path / "a.txt")
    at = dict(zip(capture.names, capture.positions[0], strict=True))
    assert at["Head"][1] > at["Neck"][1] > at["Hips"][1] > at["LeftLeg"][1] > at["LeftFoot"][1]
    assert at["LeftHand"][0] > at["LeftArm"][0] > 0 > at["RightArm"][0] > at["RightHand"][0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no frames"),
        ("1,2,3\n", "3 numbers, expected 117"),
        (",".join(["0"] * 117) + "\n" + ",".join(["0"] * 116 + ["x"]), "line 2.*not a number"),
        (",".join(["nan"] * 117), "line 1.*finite"),
    ],
)
def test_invalid_file_is_reported(tmp_path, text: str, words: str) -> None:
    path = tmp_path / "a.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_expmap(path)
    with pytest.raises(InputError, match="the file does not exist"):
        read_expmap(tmp_path / "none.txt")
