"""Rokoko: the live stream of Rokoko Studio, JSON v3 over UDP, that its plug-ins read.

Performers and human characters are actors, other rigged characters are characters, and everything else is a
prop. Positions and rotations are of the world, in Unity's axes. The rotation of an actor's joint is that of
Rokoko's own skeleton: the rotation since the T-pose, times the joint's rotation in Rokoko's T-pose.

Source of the format: the readers in Rokoko's plug-ins for Unity (JsonLiveSerializerV3.cs, Actor.cs) and for
Blender (live_data_manager.py).
"""

from __future__ import annotations

from functools import cache
from typing import Any

import lz4.frame
import msgspec
import numpy as np

from enliven.arrays import AnyArray
from enliven.document import BOX
from enliven.person import HumanPose, unity_position, unity_rotation
from enliven.rotation import from_matrix, multiply
from enliven_edge.outputs.live_frame import LiveFrame
from enliven_edge.outputs.output import LiveOutput

PORT = 14043
"""Default port of the plug-ins."""
_VERSION = "3,0"
_HALF = float(np.sqrt(0.5))
_TRUNK = (0.0, 0.0, 1.0, 0.0)
"""Rotation (x, y, z, w) of the trunk's joints of Rokoko's skeleton in its T-pose: half a turn about Z."""
_SIDES = {
    "Left": {
        "Shoulder": (0.0, 0.0, _HALF, -_HALF),
        "Arm": (-0.5, -0.5, 0.5, -0.5),
        "Leg": (0.0, _HALF, 0.0, _HALF),
        "Foot": (0.0, _HALF, -_HALF, 0.0),
    },
    "Right": {
        "Shoulder": (0.0, 0.0, _HALF, _HALF),
        "Arm": (0.5, -0.5, 0.5, 0.5),
        "Leg": (0.0, -_HALF, 0.0, _HALF),
        "Foot": (0.0, -_HALF, _HALF, 0.0),
    },
}
"""Rotations (x, y, z, w) of Rokoko's skeleton in its T-pose, in Unity's axes."""
JOINTS: tuple[tuple[str, str, tuple[float, ...]], ...] = (
    ("hip", "Hips", (0.0, 0.0, 0.0, 1.0)),
    ("spine", "Spine", _TRUNK),
    ("chest", "Chest", _TRUNK),
    ("neck", "Neck", _TRUNK),
    ("head", "Head", _TRUNK),
    *(
        (f"{side.lower()}{joint}", f"{side}{bone}", _SIDES[side][group])
        for side in ("Left", "Right")
        for joint, bone, group in (
            ("Shoulder", "Shoulder", "Shoulder"),
            ("UpperArm", "UpperArm", "Arm"),
            ("LowerArm", "LowerArm", "Arm"),
            ("Hand", "Hand", "Arm"),
            ("UpLeg", "UpperLeg", "Leg"),
            ("Leg", "LowerLeg", "Leg"),
            ("Foot", "Foot", "Foot"),
            ("Toe", "Toes", "Foot"),
            ("ToeEnd", "Toes", "Foot"),
        )
    ),
)
"""The joints of an actor: name in the stream, bone of the humanoid, and rotation in Rokoko's T-pose."""
_NAMES = [name for name, _, _ in JOINTS]
_T_POSE_BEFORE_MIRROR = np.array([(w, x, -y, -z) for _, _, (x, y, z, w) in JOINTS])
"""(23, 4) the same rotations as (w, x, y, z) in enliven's axes: the mirror is its own inverse."""
_META = {"hasGloves": False, "hasLeftGlove": False, "hasRightGlove": False, "hasBody": True, "hasFace": False}
"""Parts of an actor that are sent: the body alone."""
_FALLBACKS = {"Chest": "Spine", "Spine": "Hips", "Neck": "Head", "Head": "Chest"}
"""The bone that replaces a missing one. The chest replaces a shoulder, and the foot the toes."""
_COLOURS = ((255, 105, 70), (70, 160, 255), (120, 220, 90), (250, 200, 60))
"""Colours of the actors in Rokoko's user interfaces, sRGB."""
_PROP_TYPE = 0
"""Type NORMAL of a prop."""
_DEFAULT_FPS = 30.0
"""Frame rate that is reported before two frames have been measured."""
_MIN_STEP_S = 1e-3
"""Shortest frame time that the reported frame rate is computed from, in seconds."""


class RokokoOutput(LiveOutput):
    """Sends all performers, characters and props.

    Args:
        compress: sends LZ4 frames instead of plain JSON. The plug-in for Unity requires LZ4.
    """

    def __init__(self, compress: bool = True) -> None:
        self._compress = compress
        self._encoder = msgspec.json.Encoder()
        self._first_ns: int | None = None
        self._last_ns = 0

    def packets(self, frame: LiveFrame) -> list[bytes]:
        data = self._encoder.encode(self._scene(frame))
        return [lz4.frame.compress(data) if self._compress else data]

    def _scene(self, frame: LiveFrame) -> dict[str, Any]:
        """Returns the whole packet."""
        if self._first_ns is None or frame.time_ns < self._last_ns:
            self._first_ns = self._last_ns = frame.time_ns
        step = (frame.time_ns - self._last_ns) * 1e-9
        self._last_ns = frame.time_ns
        scene = {
            "timestamp": round((frame.time_ns - self._first_ns) * 1e-9, 4),
            "actors": _actors(frame.humans),
            "characters": _characters(frame),
            "props": _props(frame),
        }
        fps = round(1.0 / step, 2) if step >= _MIN_STEP_S else _DEFAULT_FPS
        return {"version": _VERSION, "fps": fps, "scene": scene}


def _actors(humans: list[HumanPose]) -> list[dict[str, Any]]:
    """Returns human figures as actors."""
    if not humans:
        return []
    rows = [_rows_of(human.bones) for human in humans]
    places = np.stack([human.positions[row] for human, row in zip(humans, rows, strict=True)])
    turns = np.stack([human.turns[row] for human, row in zip(humans, rows, strict=True)])
    values = _values(places, multiply(turns, _T_POSE_BEFORE_MIRROR))
    heights = places[..., 1]
    total, hips = np.ptp(heights, 1).round(4).tolist(), (heights[:, 0] - heights.min(1)).round(4).tolist()
    return [
        {
            "name": human.name,
            "color": _COLOURS[number % len(_COLOURS)],
            "meta": _META,
            "dimensions": {"totalHeight": total[number], "hipHeight": hips[number]},
            "body": {name: _placement(row) for name, row in zip(_NAMES, values[number], strict=True)},
        }
        for number, human in enumerate(humans)
    ]


@cache
def _rows_of(bones: tuple[str, ...]) -> list[int]:
    """Returns (23,) the bone of each joint of an actor, or the one that replaces a missing bone."""
    rows = []
    for _, bone, _ in JOINTS:
        name = bone
        while name not in bones:
            side = "Left" if name.startswith("Left") else "Right"
            name = f"{side}Foot" if name.endswith("Toes") else _FALLBACKS.get(name, "Chest")
        rows.append(bones.index(name))
    return rows


def _values(places: AnyArray, turns: AnyArray) -> list[Any]:
    """Returns (..., 7) rounded positions and rotations (x, y, z, w) in Unity's axes, as lists."""
    return np.concatenate([unity_position(places).round(4), unity_rotation(turns).round(5)], -1).tolist()


def _placement(values: list[float]) -> dict[str, dict[str, float]]:
    """Returns one row of :func:`_values` with its names."""
    x, y, z, i, j, k, w = values
    return {"position": {"x": x, "y": y, "z": z}, "rotation": {"x": i, "y": j, "z": k, "w": w}}


def _characters(frame: LiveFrame) -> list[dict[str, Any]]:
    """Returns the rigged characters that are not human, with a joint for each bone."""
    out = []
    for pose in frame.poses:
        info = frame.characters.get(pose.character)
        if info is None or info.humanoid is not None or info.character.names is None:
            continue
        values = _values(pose.positions, from_matrix(pose.linear))
        joints = [
            {"name": name, **_placement(row)} for name, row in zip(info.character.names, values, strict=True)
        ]
        out.append({"name": pose.character, "joints": joints})
    return out


def _props(frame: LiveFrame) -> list[dict[str, Any]]:
    """Returns the characters without a skeleton, and the loose objects."""
    placed: list[tuple[str, AnyArray, AnyArray, tuple[int, ...]]] = []
    for name, (place, turn) in frame.placements.items():
        if frame.characters[name].character.names is None:
            placed.append((name, place, turn, (200, 200, 200)))
    if frame.props is not None:
        kinds = ["box" if shape == BOX else "ball" for shape in frame.props.shapes]
        for k, (number, kind) in enumerate(zip(frame.props.ids, kinds, strict=True)):
            colour = tuple(int(part) for part in frame.props.colours[k])
            placed.append((f"{kind}-{number}", frame.props.positions[k], frame.props.turns[k], colour))
    return [
        {"name": name, "color": colour, "type": _PROP_TYPE, **_placement(_values(place, turn))}
        for name, place, turn, colour in placed
    ]
