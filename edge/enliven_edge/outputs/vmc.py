"""VMC: the protocol of virtual avatars (VirtualMotionCapture), OSC over UDP.

One port is one avatar. Its humanoid bones come from one source, and all else on the stage is sent as
trackers. The bones are local to their parents, measured from the receiver's T-pose, in Unity's axes. The root
stays at the origin of the world, and the hips carry the motion through the room.

Source of the messages: https://protocol.vmc.info/english (V2.7).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Props
from enliven.errors import InputError
from enliven.person import HumanPose, Joint, unity_position, unity_rotation
from enliven.rotation import IDENTITY, from_matrix
from enliven_edge.outputs.live_frame import PERFORMER, CharacterInfo, LiveFrame
from enliven_edge.outputs.osc_template import OscMessage, OscTemplates
from enliven_edge.outputs.output import LiveOutput

PORT = 39539
"""Default port of receivers (marionettes)."""
_STATUS = OscMessage("/VMC/Ext/OK", "iiii")
_TIME = OscMessage("/VMC/Ext/T", "f")
_ROOT = OscMessage("/VMC/Ext/Root/Pos", "f" * 7, ("root",))
_CALIBRATED = 3
"""State "Calibrated" in the message of the status. enliven needs no calibration pose."""
_NORMAL_MODE = 0
"""Calibration mode "Normal" in the message of the status."""
_ROOT_AT_ORIGIN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
_MAX_BONE_TRACKERS = 64
"""Maximum number of bones of one character that are sent as trackers, about four packets."""


class VmcOutput(LiveOutput):
    """Sends humanoid bones and trackers.

    Args:
        source: of the humanoid bones, see :meth:`LiveFrame.human`.
    """

    def __init__(self, source: str = "") -> None:
        self._source = source
        self._templates = OscTemplates()
        self._first_ns: int | None = None

    def check(self, characters: Mapping[str, CharacterInfo]) -> None:
        if self._source in characters and characters[self._source].humanoid is None:
            mend = (
                "Leave the character out of the address: it is then sent as a tracker. Or give a rigged "
                "human with --drive skeleton."
            )
            where = f"vmc output of {self._source!r}"
            raise InputError("this character has no humanoid bones", where=where, mend=mend)

    def packets(self, frame: LiveFrame) -> list[bytes]:
        if self._first_ns is None or frame.time_ns < self._first_ns:
            self._first_ns = frame.time_ns
        human = frame.human(self._source)
        there = human is not None
        seconds = (frame.time_ns - self._first_ns) * 1e-9
        numbers: list[AnyArray] = [
            np.array([there, _CALIBRATED if there else 0, _NORMAL_MODE, there, seconds]),
            _ROOT_AT_ORIGIN,
        ]
        bones = () if human is None else human.bones
        if human is not None:
            numbers.append(bone_numbers(human))
        names, placements = _trackers(frame, "" if human is None else human.name)
        numbers += placements
        return self._templates.packets((bones, tuple(names)), lambda: _messages(bones, names), numbers)


def _messages(bones: Sequence[str], trackers: Sequence[str]) -> list[OscMessage]:
    """Returns the messages of a frame."""
    return [
        *(_STATUS, _TIME, _ROOT),
        *(OscMessage("/VMC/Ext/Bone/Pos", "f" * 7, (bone,)) for bone in bones),
        *(OscMessage("/VMC/Ext/Tra/Pos", "f" * 7, (name,)) for name in trackers),
    ]


def bone_numbers(human: HumanPose) -> Float:
    """Returns (B, 7) the local position and rotation (x, y, z, w) of each bone in Unity's axes."""
    positions, turns = human.local()
    return np.concatenate([unity_position(positions), unity_rotation(turns)], -1)


def _trackers(frame: LiveFrame, human: str) -> tuple[list[str], list[AnyArray]]:
    """Returns the names and (7,) placements of everything that is not sent as humanoid bones."""
    names: list[str] = []
    positions: list[AnyArray] = []
    turns: list[AnyArray] = []

    def add(labels: Sequence[str], places: AnyArray, rotations: AnyArray) -> None:
        names.extend(labels)
        positions.append(np.reshape(places, (-1, 3)))
        turns.append(np.reshape(rotations, (-1, 4)))

    for pose in frame.poses:
        name = pose.character
        if name == human or name not in frame.placements:
            continue
        add([name], *frame.placements[name])
        bones = frame.characters[name].character.names
        if bones is not None:
            count = min(len(bones), _MAX_BONE_TRACKERS)
            labels = [f"{name}/{bone}" for bone in bones[:count]]
            add(labels, pose.positions[:count], from_matrix(pose.linear[:count]))
    for number, body in frame.performers.items():
        if f"{PERFORMER}{number}" != human:
            turn = IDENTITY if body.orientations is None else body.orientations[Joint.HIP_CENTER]
            add([f"{PERFORMER}{number}"], body.joints[Joint.HIP_CENTER], turn)
    if frame.props is not None:
        add(*_props(frame.props))
    if not names:
        return [], []
    placed = [unity_position(np.concatenate(positions)), unity_rotation(np.concatenate(turns))]
    return names, [np.concatenate(placed, -1)]


def _props(props: Props) -> tuple[list[str], AnyArray, AnyArray]:
    """Returns the names, positions and rotations of the loose objects."""
    return [f"prop-{number}" for number in props.ids], props.positions, props.turns
