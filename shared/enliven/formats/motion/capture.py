"""A motion capture from a file: a tree of joints with names, and their positions and rotations in each
frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float

UNITS: dict[str, float] = {"m": 1.0, "in": 0.0254, "cmu": 0.0254 / 0.45, "cm": 0.01, "mm": 0.001}
"""Metres per unit, by unit name. The unit of CMU's files is 1 / 0.45 inch."""
_ADULT_LEG_LENGTH_M = 0.82
"""Distance from hip to ankle of an average adult, in metres. It is used to guess the unit of a file."""


@dataclass(frozen=True)
class Capture:
    """A motion in the coordinates and the unit of its file.

    Attributes:
        names: (N,) names of the joints, parents before children. The end of a chain is called "<parent> end".
        parents: (N,) the parent of each joint, -1 at a root.
        positions: (F, N, 3) positions of the joints in the file's coordinates and unit.
        rotations: (F, N, 3, 3) rotations from joint to world. The end of a chain has its parent's rotation.
        seconds: frame time in seconds.
        notes: a sentence for each unusual property of the file.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    positions: Float
    rotations: Float
    seconds: float
    notes: tuple[str, ...] = ()

    @property
    def frames(self) -> int:
        """The number of frames."""
        return len(self.positions)

    @property
    def duration(self) -> float:
        """The time from the first frame to the last, in seconds."""
        return (self.frames - 1) * self.seconds


def forward_kinematics(parents: tuple[int, ...], offsets: Float, rotations: Float) -> tuple[Float, Float]:
    """Returns positions and world rotations of all joints, computed by forward kinematics.

    Args:
        offsets: (F or 1, N, 3) each joint's position in its parent's frame, or a root's position in the
            file's coordinates.
        rotations: (F, N, 3, 3) rotations from joint to parent.

    Returns:
        (F, N, 3) positions, and (F, N, 3, 3) rotations from joint to world.
    """
    world, positions = np.empty_like(rotations), np.empty((len(rotations), len(parents), 3))
    for j, parent in enumerate(parents):
        if parent < 0:
            positions[:, j], world[:, j] = offsets[:, j], rotations[:, j]
        else:
            positions[:, j] = positions[:, parent] + np.einsum(
                "fij,fj->fi", world[:, parent], np.broadcast_to(offsets[:, j], (len(rotations), 3))
            )
            world[:, j] = world[:, parent] @ rotations[:, j]
    return positions, world


def guess_unit(leg: float) -> str:
    """Guesses the unit of a file. In this unit, the leg's length (hip to ankle, ``leg`` units) is most
    similar to that of an average adult.
    """
    return min(UNITS, key=lambda name: abs(np.log(max(leg, 1e-9) * UNITS[name] / _ADULT_LEG_LENGTH_M)))
