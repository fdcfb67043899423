"""Tests of landmarks in a real colour image, lifted by real depth, of a person who turns around completely.

It needs the real recordings, and in ENLIVEN_MEDIAPIPE a Python that has mediapipe 0.10.21 (with its model).
"""

import os
from pathlib import Path

import numpy as np
import pytest

from enliven.camera import project, world_from_level_camera
from enliven.person.joints import Joint
from enliven_edge.importing.depth_images import OpenCvDepthReader
from enliven_edge.landmarks.lifting import Lifter
from enliven_edge.landmarks.source import MediaPipeSettings, MediaPipeSource

pytestmark = pytest.mark.real
DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))
TURN = DATA / "depth" / "uva_cv2_person_turn"
PYTHON = os.environ.get("ENLIVEN_MEDIAPIPE", "")


@pytest.mark.skipif(not TURN.is_dir(), reason="the real recordings are not here")
@pytest.mark.skipif(not PYTHON, reason="ENLIVEN_MEDIAPIPE names no Python that has mediapipe")
def test_a_turning_person_s_trunk_and_arms_are_found_and_the_rest_is_not_invented():
    frames = [f for f in OpenCvDepthReader().read(sorted(TURN.iterdir())) if f.colour is not None]
    mount, lifter, widths, sides = world_from_level_camera(1.2), Lifter(), [], []
    with MediaPipeSource(MediaPipeSettings(python=PYTHON)) as source:
        for frame in frames:
            (landmarks,) = source.find(frame.colour, frame.time_ns)
            body = lifter.lift(landmarks, frame, mount, 1)
            local = (body.joints - mount[:3, 3]) @ mount[:3, :3]
            sure = body.confidence > 0.5
            assert sure[[Joint.HEAD, Joint.SHOULDER_CENTER]].all()
            # Confident joints are inside the person: the surface is at most 0.2 m nearer.
            u, v = np.rint(project(local[sure], frame.intrinsics)).astype(int).T
            surface = frame.depth[v, u] * 1e-3
            is_seen = surface > 0
            gap = local[sure][is_seen, 2] - surface[is_seen]
            assert (gap > -0.05).all() and (gap < 0.25).all()
            legs = [j for j in Joint if "KNEE" in j.name or "ANKLE" in j.name or "FOOT" in j.name]
            assert body.confidence[legs].max() == 0.0
            widths.append(
                np.linalg.norm(body.joints[Joint.SHOULDER_LEFT] - body.joints[Joint.SHOULDER_RIGHT])
            )
            sides.append(local[Joint.SHOULDER_LEFT, 0] - local[Joint.SHOULDER_RIGHT, 0])
    assert 0.25 < np.median(widths) < 0.45
    assert sides[0] > 0.25 > -0.2 > sides[5], "the left shoulder is on the other side from behind"
