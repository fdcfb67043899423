"""VRChat: sends up to eight OSC trackers and the head, for full-body tracking without tracker hardware.

Positions are metres and rotations are Euler angles in degrees, both in Unity's world. VRChat expects trackers
of a person with the height that the user has set in VRChat, so positions are scaled to that height.

Source of the messages: https://docs.vrchat.com/docs/osc-trackers
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.outputs.live_frame import PERFORMER, LiveFrame
from enliven.outputs.osc_template import OscMessage, OscTemplates
from enliven.outputs.output import LiveOutput
from enliven.outputs.row_kernels import write_unity_angles
from enliven.person import BODY_BONE_NAMES, Body, HumanPose, Joint, unity_position

PORT = 9000
"""Default port of VRChat."""
TRACKERS: tuple[tuple[str, str, Joint], ...] = (
    ("1", "Hips", Joint.HIP_CENTER),
    ("2", "Chest", Joint.SHOULDER_CENTER),
    ("3", "LeftFoot", Joint.ANKLE_LEFT),
    ("4", "RightFoot", Joint.ANKLE_RIGHT),
    ("5", "LeftUpperLeg", Joint.KNEE_LEFT),
    ("6", "RightUpperLeg", Joint.KNEE_RIGHT),
    ("7", "LeftUpperArm", Joint.ELBOW_LEFT),
    ("8", "RightUpperArm", Joint.ELBOW_RIGHT),
    ("head", "Head", Joint.HEAD),
)
"""The trackers: the name in the OSC address, the bone that the tracker would be attached to, and the joint
next to it."""
_MESSAGES = [
    OscMessage(f"/tracking/trackers/{name}/{value}", "fff")
    for name, _, _ in TRACKERS
    for value in ("position", "rotation")
]
_JOINTS = np.array([int(joint) for _, _, joint in TRACKERS])
_BONES = np.array([BODY_BONE_NAMES.index(bone) for _, bone, _ in TRACKERS])
_MIN_HEIGHT_M = 0.5
"""Minimum measured height in metres that is used for scaling. Smaller values are measurement errors."""


class VrchatOutput(LiveOutput):
    """An output that sends the trackers of one performer.

    Args:
        source: ``performer-N``. If empty, the performer with the lowest number is sent.
        height: the user's height in VRChat, metres. 0 means the performer's own height.
    """

    def __init__(self, source: str = "", height: float = 0.0) -> None:
        self._source, self._height = source, height
        self._templates = OscTemplates()

    def encode_packets(self, frame: LiveFrame) -> list[bytes]:
        """Returns the packets of the performer's trackers and head, or no packets if the performer is out of
        view.
        """
        number = (
            int(self._source.removeprefix(PERFORMER)) if self._source else min(frame.performers, default=0)
        )
        body, human = frame.performers.get(number), frame.find_human_performer(number)
        if body is None or human is None:
            return []
        values = tracker_values(body, human, self._height)
        return self._templates.packets("trackers", lambda: _MESSAGES, values.ravel())


def tracker_values(body: Body, human: HumanPose, height: float) -> Float:
    """Returns (9, 2, 3) position in metres and Euler angles in degrees of each tracker.

    Args:
        height: height in metres to which positions are scaled, about the origin on the floor. 0 means no
            scaling.
    """
    scale = height / max(body.height, _MIN_HEIGHT_M) if height > 0.0 else 1.0
    out = np.empty((len(TRACKERS), 2, 3))
    out[:, 0] = unity_position(scale * body.joints[_JOINTS])
    write_unity_angles(human.turns, _BONES, out)
    return out
