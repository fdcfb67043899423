"""Tests that a person who turns in front of a still camera becomes a character in the window, over the
wire.
"""

import copy
import sys
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest
from scanning_edge import ScanningEdge

from enliven.person import Joint
from enliven.scanning import ScanState
from enliven.wire import Scan, ScanMode
from enliven_viewer.studio.features.scan.advice import choose_advice

sys.path.insert(0, str(Path(__file__).parent))
from scan_window import Begun, Window
from turning import TurningPerson

STILL, TURNED, STEP = 3, 62, 5.8
"""Number of images before the turn, number of images of one full turn, and degrees per image."""


@pytest.mark.slow
def test_full_turn_creates_a_character_with_named_ends(tmp_path):
    scene = TurningPerson(640)
    images = [scene.frame(n, max(n - STILL, 0) * np.radians(STEP)) for n in range(STILL + TURNED + 6)]
    messages = []
    with closing(ScanningEdge()) as edge, ExitStack() as ends:
        edge.viewer()
        window = ends.enter_context(closing(Window(edge, tmp_path)))
        edge.followers.append(window)
        scan = window.scan
        edge.until(lambda: not scan.describe_missing_stage(), "the stage in the window")
        scan.mode, scan.name = ScanMode.PERSON, "me"
        edge.until(Begun(scan), "the beginning")
        words = [choose_advice(scan.message).text]
        edge.feed_frames(images, lambda: messages.append((scan.message, choose_advice(scan.message).text)))
        assert scan.message.phase == "scanning", (
            "they stood still for less than a second of the camera's clock"
        )
        edge.until(lambda: scan.message.missing == 0.0, "all sides in the window")
        edge.feed_frames(images[-1:])
        assert scan.message.missing == 0.0
        edge.until(lambda: "me" in window.editor.project.characters, "the character, without a key")
    assert words == ["Stand 1 to 3 m in front of the camera, with your whole body in view"]
    assert all(message.thing == "person" for message, _ in messages)
    missing = [message.missing for message, _ in messages]
    assert (np.diff(missing) <= 0).all() and missing[-1] == 0.0
    assert any(text.startswith("Turn slowly on the spot: 5") for _, text in messages)
    assert messages[-1][1] == "All sides are scanned: stand still"
    character = window.editor.project.characters["me"]
    low, high = character.mesh.bounds
    assert low[1] == pytest.approx(0.0, abs=1e-3) and high[1] == pytest.approx(1.73, abs=0.06)
    away = np.linalg.norm(character.ends[:, None] - character.mesh.vertices, axis=2).min(1)
    assert away.max() < 0.08, "head, hands and feet lie at its surface"
    assert (
        character.joints.shape == (20, 3)
        and np.linalg.norm(character.joints[Joint.HAND_LEFT] - character.ends[1]) < 0.15
    )
    head, left, right, *feet = character.ends
    assert head[1] > 1.6 and left[0] > right[0] and max(foot[1] for foot in feet) < 0.2


def test_a_copy_is_scanned_on_by_itself_with_the_same_tracker():
    from enliven.scanning import ScanSettings, VolumeSettings
    from enliven_edge.scanning.person import PersonScanner

    scene = TurningPerson(320)
    volume = VolumeSettings(voxel=0.016, reach=3.5, far=3.5)
    original = PersonScanner(ScanSettings(volume=volume, least_depth=0.01))
    for n in range(4):
        original.add(scene.frame(n))
    other = copy.deepcopy(original)
    fused = len(original.poses)
    assert other.add(scene.frame(4)).state is ScanState.SCANNING
    assert len(original.poses) == fused and len(other.poses) == fused + 1
    assert other._people is original._people


def test_a_person_and_something_that_is_moved_are_refused():
    for other in ({"moved": True}, {"turned": True}, {"within": 1.5}):
        with pytest.raises(ValueError, match="a scan can have only one mode"):
            Scan("start", mode=ScanMode.PERSON, **other)
