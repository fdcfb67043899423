"""A motion capture from a file: a named tree of joints, posed frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float

UNITS: dict[str, float] = {"m": 1.0, "in": 0.0254, "cmu": 0.0254 / 0.45, "cm": 0.01, "mm": 0.001}
"""Metres in a unit. CMU's files count 0.45ths of an inch."""
_ADULT_LEG_LENGTH_M = 0.82
"""Distance from hip to ankle of an average adult, in metres. The unit of a file is guessed from it."""


@dataclass(frozen=True)
class Capture:
    """A motion as its file tells it.

    Attributes:
        names: (N,) the joints, parents before children; the end of a chain is called "<parent> end".
        parents: (N,) the parent of each joint, -1 at a root.
        positions: (F, N, 3) the joints in the file's space and unit.
        rotations: (F, N, 3, 3) world_from_joint; an end has its parent's.
        seconds: time from one frame to the next.
        notes: what was odd about the file, a sentence each.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    positions: Float
    rotations: Float
    seconds: float
    notes: tuple[str, ...] = ()

    @property
    def frames(self) -> int:
        """How many frames there are."""
        return len(self.positions)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (self.frames - 1) * self.seconds


def composed(parents: tuple[int, ...], offsets: Float, rotations: Float) -> tuple[Float, Float]:
    """Forward kinematics.

    Args:
        offsets: (F or 1, N, 3) each joint in its parent's frame (a root: in the file's space).
        rotations: (F, N, 3, 3) parent_from_joint.

    Returns:
        (F, N, 3) positions, (F, N, 3, 3) world_from_joint.
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
    """Returns the unit in which ``leg`` (hip to ankle, in the file's numbers) is nearest to a person's
    leg."""
    return min(UNITS, key=lambda name: abs(np.log(max(leg, 1e-9) * UNITS[name] / _ADULT_LEG_LENGTH_M)))
