"""Tests of real motion captures of six conventions on a performer whose soles stay on the floor.

The mapping was developed with these files. These tests check properties that must hold for any file.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from enliven.formats.motion.bvh import read_bvh
from enliven.formats.motion.capture import guess_unit
from enliven.formats.motion.expmap import read_expmap
from enliven.motion_clips.capture_roles import find_roles
from enliven.person.joints import Joint
from enliven_synthesis.body.performer import Performer
from enliven_synthesis.motion.mocap import CapturedMotion

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data"))
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings (ENLIVEN_DATA) are not here"),
]
FILES = sorted(DATA.glob("bvh/*/*.bvh")) + sorted(DATA.glob("cmu_expmap/t*.txt"))


def read(path: Path):
    return read_bvh(path) if path.suffix == ".bvh" else read_expmap(path)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem[-24:])
def test_a_capture_is_danced(path: Path) -> None:
    capture = read(path)
    roles = find_roles(capture)
    assert np.isfinite(capture.positions).all()
    performer = Performer()
    motion = CapturedMotion(performer, capture, 0.1, min(capture.duration, 8.0))
    step = max(1, round(1 / 15 / capture.seconds))
    figures = [motion.figure(t) for t in np.arange(0.0, motion.duration, step * capture.seconds)]
    soles = np.array([performer.soles(f).min() for f in figures])
    assert soles.min() > -0.03
    assert np.percentile(soles, 30) < 0.02
    joints = np.stack([f.joints for f in figures])
    # Arms and legs have the captured directions, whatever the body's proportions.
    first = round(0.1 / capture.seconds)
    for pair, a, b in ((roles.shoulders, 4, 5), (roles.hips, 12, 13)):
        nearer = capture.positions[first::step][: len(joints)]
        lower = roles.elbows if pair is roles.shoulders else roles.knees
        theirs = nearer[:, lower[0]] - nearer[:, pair[0]]
        ours = joints[:, b] - joints[:, a]
        slope = [v[:, 1] / np.linalg.norm(v, axis=1) for v in (theirs, ours)]
        assert np.median(np.abs(slope[0] - slope[1])) < 0.05  # heights do not depend on the heading
    # The performers are upright: heads are up for most of the time.
    assert np.median(joints[:, Joint.HEAD, 1]) > 1.3


def test_units_are_guessed() -> None:
    expected = {
        "bandai_namco": "cm",
        "cmu_mirrors/02_01": "cmu",
        "Boxing": "cm",
        "pymo": "in",
        "train_": "cmu",
    }
    for part, unit in expected.items():
        path = next(p for p in FILES if part in str(p))
        capture = read(path)
        roles = find_roles(capture)
        p = capture.positions
        leg = np.linalg.norm(p[:, roles.hips[0]] - p[:, roles.knees[0]], axis=1)
        leg = leg + np.linalg.norm(p[:, roles.knees[0]] - p[:, roles.ankles[0]], axis=1)
        assert guess_unit(float(np.median(leg))) == unit, path.name


def test_the_row_too_many_of_boxing_is_read() -> None:
    capture = read_bvh(DATA / "bvh" / "cmu_mirrors" / "Boxing_Toes.bvh")
    assert capture.frames == 3070
    assert capture.notes == ("the header states 3069 frames, but the file has 3070",)


def test_mending_the_root_stops_standing_feet() -> None:
    """The error in the files makes standing feet slide. After the repair they slide less than half as
    much.
    """
    speed = {}
    for remedy in (False, True):
        capture = read_expmap(DATA / "cmu_expmap" / "train_directing_traffic_4.txt", repairs_root=remedy)
        slides = []
        for name in ("LeftToeBase", "RightToeBase"):
            toe = capture.positions[1:, capture.names.index(name)]
            moved = np.linalg.norm(np.diff(toe[:, [0, 2]], axis=0), axis=1)
            slides.append(np.median(moved[toe[:-1, 1] < np.percentile(toe[:, 1], 30)]))
        speed[remedy] = np.mean(slides)
    assert speed[True] < 0.5 * speed[False]
