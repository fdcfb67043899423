"""VMC (Virtual Motion Capture protocol): sends avatars as OSC over UDP.

Each port receives one avatar. Its humanoid bones come from one source, and everything else on the stage is
sent as trackers. The rotations of bones are relative to their parents and to the receiver's T-pose, in
Unity's axes. The root stays at the origin of the world, and the hips contain the travel through the room.

Source of the messages: https://protocol.vmc.info/english (V2.7).
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence

import numpy as np

from enliven.arrays import Int
from enliven.errors import InputError
from enliven.outputs.live_frame import PERFORMER, CharacterInfo, LiveFrame, StageRows
from enliven.outputs.osc_template import OscMessage, OscTemplates
from enliven.outputs.output import LiveOutput
from enliven.outputs.row_kernels import write_local_rows, write_unity_rows

PORT = 39539
"""Default port of receivers (marionettes)."""
_STATUS = OscMessage("/VMC/Ext/OK", "iiii")
_TIME = OscMessage("/VMC/Ext/T", "f")
_ROOT = OscMessage("/VMC/Ext/Root/Pos", "f" * 7, ("root",))
_CALIBRATED = 3
"""Value of the state "Calibrated" in the status message. It is always sent, because enliven needs no
calibration pose."""
_NORMAL_MODE = 0
"""Value of the calibration mode "Normal" in the status message."""
_ROOT_AT_ORIGIN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
_FIRST_BONE = 5 + len(_ROOT_AT_ORIGIN)
"""Index of the first number of the bones. The numbers of status, time and root come before it."""
_MAX_TRACKER_SETS = 64
"""Maximum number of cached lists of trackers. It is enough, because few sets of performers and characters
occur on a stage."""
_MAX_BONE_TRACKERS = 64
"""Maximum number of one character's bones that are sent as trackers. They need about four packets."""


class VmcOutput(LiveOutput):
    """An output that sends humanoid bones and trackers.

    Args:
        source: the source of the humanoid bones, see :meth:`LiveFrame.human`.
    """

    def __init__(self, source: str = "") -> None:
        self._source = source
        self._templates = OscTemplates()
        self._trackers: dict[Hashable, Int] = {}
        self._first_ns: int | None = None

    def check(self, characters: Mapping[str, CharacterInfo]) -> None:
        """Checks that the character that the address names has humanoid bones.

        Raises:
            InputError: if that character is on the stage and is not a rigged human.
        """
        if self._source in characters and characters[self._source].humanoid is None:
            remedy = (
                "Remove the character from the address to send it as a tracker. Or use a rigged "
                "human with --drive skeleton."
            )
            where = f"vmc output of {self._source!r}"
            raise InputError("this character has no humanoid bones", where=where, remedy=remedy)

    def encode_packets(self, frame: LiveFrame) -> list[bytes]:
        """Returns the state of the avatar, its root at the origin, its bones, and trackers for everything
        else.

        Without a person or humanoid character, the messages report that no avatar is loaded. Only trackers
        follow.
        """
        if self._first_ns is None or frame.time_ns < self._first_ns:
            self._first_ns = frame.time_ns
        human, rows = frame.find_human(self._source), frame.rows
        bones, name = ((), "") if human is None else (human.bones, human.name)
        key = (rows.key, bones, name)
        if key not in self._trackers:
            if len(self._trackers) >= _MAX_TRACKER_SETS:
                self._trackers.clear()
            self._trackers[key] = tracker_rows(rows, name)
        chosen = self._trackers[key]
        numbers = np.empty(_FIRST_BONE + 7 * (len(bones) + len(chosen)))
        is_present = human is not None
        seconds = (frame.time_ns - self._first_ns) * 1e-9
        numbers[:5] = is_present, _CALIBRATED if is_present else 0, _NORMAL_MODE, is_present, seconds
        numbers[5:_FIRST_BONE] = _ROOT_AT_ORIGIN
        end = _FIRST_BONE + 7 * len(bones)
        if human is not None:
            write_local_rows(
                human.parents, human.positions, human.turns, numbers[_FIRST_BONE:end].reshape(-1, 7)
            )
        write_unity_rows(rows.values, chosen, numbers[end:].reshape(-1, 7))
        return self._templates.packets(key, lambda: _messages(bones, rows, chosen), numbers)


def _messages(bones: Sequence[str], rows: StageRows, trackers: Int) -> list[OscMessage]:
    """Returns the messages of a frame."""
    labels = rows.labels()
    return [
        *(_STATUS, _TIME, _ROOT),
        *(OscMessage("/VMC/Ext/Bone/Pos", "f" * 7, (bone,)) for bone in bones),
        *(OscMessage("/VMC/Ext/Tra/Pos", "f" * 7, (labels[row],)) for row in trackers),
    ]


def tracker_rows(rows: StageRows, human: str) -> Int:
    """Returns the row numbers (T,) of everything that is not sent as humanoid bones.

    Args:
        human: name of the figure that is sent as humanoid bones.
    """
    chosen = [number for number, name in enumerate(rows.names) if name != human]
    for name, bones in zip(rows.names, rows.bone_slices(), strict=True):
        if name != human:
            chosen += range(bones.start, min(bones.stop, bones.start + _MAX_BONE_TRACKERS))
    _, performers, props = rows.key
    first = len(rows.values) - len(performers) - len(props)
    chosen += [first + k for k, number in enumerate(performers) if f"{PERFORMER}{number}" != human]
    chosen += range(first + len(performers), len(rows.values))
    return np.array(chosen, np.int64)
