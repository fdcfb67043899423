"""OSC trackers as a sensor. The points that a program sends for VRChat's full-body tracking become a body.

Only positions are used. Rotations are ignored, because they depend on how a tracker is strapped on. VRChat
needs a calibration for them.
"""

from __future__ import annotations

import math
import re
import time

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.person import Body, Joint, from_unity_position
from enliven.rotation import unit
from enliven_edge.sensors.streams.osc_opening import open_osc_port
from enliven_edge.sensors.streams.stream_sensor import MAX_METRES, Message, StreamSensor

PLACES = {
    "head": Joint.HEAD,
    "hip": Joint.HIP_CENTER,
    "chest": Joint.SHOULDER_CENTER,
    **{
        f"{side} {place}": Joint[f"{joint}_{side.upper()}"]
        for side in ("left", "right")
        for place, joint in (("foot", "ANKLE"), ("knee", "KNEE"), ("elbow", "ELBOW"))
    },
}
"""The joint at each place on the body where a tracker can be."""
USUAL_ORDER = "hip, chest, left foot, right foot, left knee, right knee, left elbow, right elbow"
"""Places of the trackers 1 to 8 on the body, as enliven's own output sends them."""
_ADDRESS = re.compile(r"/tracking/trackers/(head|[1-8])/position")
_MAX_AGE_S = 1.0
"""Seconds without a message after which a tracker counts as absent."""
_SPINE_FRACTION = 0.28
"""Relative position of the spine joint between the hips (0) and the neck (1)."""
_TRUNK_M = 0.43
"""Metres from the hip centre to the shoulder centre of an adult 1.75 m tall. All other offsets are scaled
with this distance."""
_UP = np.array([0.0, 1.0, 0.0])
"""(3,) unit vector of the upward direction."""


class TrackerSensor(StreamSensor[list[Message]]):
    """Delivers one person from OSC trackers. The trackers of hip and chest are required.

    Joints without a tracker are placed by average proportions, and have confidence 0.

    Args:
        port: UDP port to listen on. Programs send trackers to 9000 by default.
        host: address to listen on. "0.0.0.0" also accepts other machines.
        order: places on the body of the trackers 1, 2, ..., separated by commas.

    Raises:
        InputError: for a wrong port or place.
        ResourceError: for a port in use, or if python-osc is missing.
    """

    def __init__(self, port: int = 9000, host: str = "127.0.0.1", order: str = USUAL_ORDER) -> None:
        self._places = _joint_by_tracker(order)
        super().__init__("osc-trackers", "trackers", open_osc_port("osc-trackers", port, host))
        self._points: dict[Joint, tuple[Float, float]] = {}

    def _store_motion(self, data: list[Message]) -> bool:
        """Stores the positions in a frame. Returns True if there was a position."""
        counts = False
        for address, arguments in data:
            match = _ADDRESS.fullmatch(address)
            joint = self._places.get(match[1]) if match else None
            if joint is None or len(arguments) < 3:
                continue
            numbers = [
                number
                for number in arguments[:3]
                if isinstance(number, float | int) and math.isfinite(number)
            ]
            if len(numbers) == 3 and max(map(abs, numbers)) < MAX_METRES:
                self._points[joint] = (from_unity_position(np.array(numbers, np.float64)), time.monotonic())
                counts = True
        return counts

    def _bodies(self) -> list[Body]:
        """Returns the person with the newest positions, or no person without a hip and a chest."""
        now = time.monotonic()
        points = {
            joint: place for joint, (place, seen_s) in self._points.items() if now - seen_s < _MAX_AGE_S
        }
        if not {Joint.HIP_CENTER, Joint.SHOULDER_CENTER} <= points.keys():
            return []
        return [body_of_points(points)]


def body_of_points(points: dict[Joint, Float]) -> Body:
    """Returns a body with the given joints. The other joints are placed by average proportions.

    Args:
        points: (3,) position in metres by joint, at least of the hip centre and the shoulder centre.
    """
    hip, chest = points[Joint.HIP_CENTER], points[Joint.SHOULDER_CENTER]
    up = unit(chest - hip)
    size = float(np.linalg.norm(chest - hip)) / _TRUNK_M
    across = _compute_left_direction(points, up)
    joints = np.empty((len(Joint), 3))
    joints[Joint.HIP_CENTER], joints[Joint.SHOULDER_CENTER] = hip, chest
    joints[Joint.SPINE] = hip + _SPINE_FRACTION * (chest - hip)
    joints[Joint.HEAD] = chest + 0.2 * size * up
    for side, sign in (("LEFT", 1.0), ("RIGHT", -1.0)):
        joints_by_name = {name: Joint[f"{name}_{side}"] for name in _SIDE_JOINTS}
        joints[joints_by_name["HIP"]] = hip + size * (0.085 * sign * across - 0.08 * up)
        joints[joints_by_name["SHOULDER"]] = chest + size * (0.185 * sign * across - 0.05 * up)
        for chain, lengths, direction in (
            (("SHOULDER", "ELBOW", "WRIST", "HAND"), (0.285, 0.25, 0.085), -up),
            (("HIP", "KNEE", "ANKLE"), (0.43, 0.41), -up),
        ):
            for k, length in enumerate(lengths):
                begin, end = joints_by_name[chain[k]], joints_by_name[chain[k + 1]]
                place = points.get(end)
                joints[end] = joints[begin] + size * length * direction if place is None else place
                if np.any(joints[end] - joints[begin]):
                    direction = unit(joints[end] - joints[begin])
        toes = size * (0.12 * unit(np.cross(across, _UP)) - 0.05 * _UP)
        joints[joints_by_name["FOOT"]] = joints[joints_by_name["ANKLE"]] + toes
    confidence = np.zeros(len(Joint))
    for joint, place in points.items():
        joints[joint], confidence[joint] = place, 1.0
    return Body(1, joints, confidence)


def _compute_left_direction(points: dict[Joint, Float], up: Float) -> Float:
    """Returns the (3,) unit direction to the person's left, from pairs of trackers, or else +X."""
    across = np.zeros(3)
    for name in ("ELBOW", "KNEE", "ANKLE"):
        left, right = points.get(Joint[f"{name}_LEFT"]), points.get(Joint[f"{name}_RIGHT"])
        if left is not None and right is not None:
            across += left - right
    across -= (across @ up) * up
    return unit(across) if np.linalg.norm(across) > 0.02 else np.array([1.0, 0.0, 0.0])


_SIDE_JOINTS = ("SHOULDER", "ELBOW", "WRIST", "HAND", "HIP", "KNEE", "ANKLE", "FOOT")
"""Names of the joints of one side of the body."""


def _joint_by_tracker(order: str) -> dict[str, Joint]:
    """Returns the joint of each tracker, by the tracker's name in its OSC address.

    Raises:
        InputError: for an unknown place, or too many places.
    """
    words = [" ".join(word.lower().replace("_", " ").split()) for word in order.split(",")]
    unknown = [word for word in words if word not in PLACES]
    if unknown or len(words) > 8:
        problem = (
            f"{unknown[0]!r} is not a place of a tracker on the body"
            if unknown
            else f"{len(words)} places are named, but at most 8 are possible"
        )
        raise InputError(problem, where="sensor osc-trackers", remedy=f"Known places: {', '.join(PLACES)}.")
    return {"head": Joint.HEAD, **{str(number): PLACES[word] for number, word in enumerate(words, 1)}}
