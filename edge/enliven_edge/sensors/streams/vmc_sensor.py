"""VMC as a sensor. The humanoid bones that another program sends become a body."""

from __future__ import annotations

import math

import numpy as np

from enliven.errors import InputError
from enliven.person import (
    Body,
    HumanPose,
    body_from_human_pose,
    compute_standing_offset,
    from_unity_position,
    from_unity_rotation,
)
from enliven.rotation import IDENTITY, multiply, normalized, rotate
from enliven_edge.sensors.streams.osc_opening import open_osc_port
from enliven_edge.sensors.streams.stream_sensor import MAX_METRES, Message, StreamSensor

_BONE = "/VMC/Ext/Bone/Pos"
_ROOT = "/VMC/Ext/Root/Pos"
_STATUS = "/VMC/Ext/OK"
_MIN_OFFSET_M = 1e-3
"""Minimum length in metres of a local position. Shorter positions count as missing, because some programs
send only rotations."""


class VmcSensor(StreamSensor[list[Message]]):
    """Delivers the figure that a program sends by the VMC protocol, such as a motion capture suit's software.

    For the meaning of rotations and positions see :mod:`enliven.outputs.vmc`. If a program sends no positions
    of the bones, the body has average proportions.

    Args:
        port: UDP port to listen on. Programs that send VMC use 39539 by default.
        host: address to listen on. "0.0.0.0" also accepts other machines.
        height: metres, height of the person, for programs that send no positions of the bones.

    Raises:
        InputError: for a wrong port or height.
        ResourceError: for a port in use, or if python-osc is missing.
    """

    def __init__(self, port: int = 39539, host: str = "127.0.0.1", height: float = 1.75) -> None:
        if not 0.5 <= height <= 2.5:
            raise InputError(
                f"the height is {height} m", where="sensor vmc", remedy="Set height to 0.5 to 2.5 m."
            )
        self._height = height
        super().__init__("vmc", "bones", open_osc_port("vmc", port, host))
        self._bones: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._root = (np.zeros(3), IDENTITY)
        self._is_loaded = True

    def _store_motion(self, data: list[Message]) -> bool:
        """Stores the bones of a frame.

        Returns True if it contained a bone, or a message that bones are missing.
        """
        counts = False
        for address, arguments in data:
            if address == _STATUS and arguments and isinstance(arguments[0], int):
                self._is_loaded = arguments[0] != 0
                counts = counts or not self._is_loaded
            elif address in (_BONE, _ROOT) and (placed := _parse_bone_placement(arguments)) is not None:
                name, place, turn = placed
                if address == _ROOT:
                    self._root = (place, turn)
                else:
                    self._bones[name] = (place, turn)
                    counts = True
        return counts

    def _bodies(self) -> list[Body]:
        """Returns the body of the newest bones, or no body if the sender has sent no bones."""
        if not self._is_loaded or "Hips" not in self._bones:
            return []
        place, turn = self._root
        names, positions, turns = [], list[np.ndarray](), list[np.ndarray]()
        # A bone's pose can be computed only after that of its parent. So sort the bones by their depth in the
        # hierarchy.
        for name in HumanPose.sort_bones(self._bones):
            offset, rotation = self._bones[name]
            parent = next((above for above in HumanPose.ancestors(name) if above in names), None)
            if parent is None:
                start, above = place, turn
            else:
                start, above = positions[names.index(parent)], turns[names.index(parent)]
                if float(np.linalg.norm(offset)) < _MIN_OFFSET_M:
                    offset = compute_standing_offset(name, parent, self._height)
            names.append(name)
            positions.append(start + rotate(above, offset))
            turns.append(multiply(above, rotation))
        human = HumanPose(self.name, tuple(names), np.stack(positions), np.stack(turns))
        return [body_from_human_pose(human, 1)]


def _parse_bone_placement(arguments: list[object]) -> tuple[str, np.ndarray, np.ndarray] | None:
    """Returns the name, position and rotation of a bone in enliven's axes, or None for invalid arguments."""
    if len(arguments) < 8 or not isinstance(arguments[0], str):
        return None
    numbers = arguments[1:8]
    if not all(isinstance(number, float | int) and math.isfinite(number) for number in numbers):
        return None
    values = np.array(numbers, np.float64)
    if np.abs(values[:3]).max() > MAX_METRES or not np.any(values[3:]):
        return None
    return arguments[0], from_unity_position(values[:3]), normalized(from_unity_rotation(values[3:]))
