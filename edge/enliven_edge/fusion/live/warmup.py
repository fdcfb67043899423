"""Compiles the kernels of fusion before the first frame is due."""

from __future__ import annotations

from functools import cache

import numpy as np

from enliven.arrays import Float
from enliven.person import Body
from enliven.rotation import IDENTITY
from enliven_edge.fusion.live.fuser import Fuser
from enliven_edge.tracking.body_model import Posture, lengths_for_height, standing


@cache
def warm_up_fusion() -> None:
    """Fuses a few frames of a standing person from two sensors, with orientations."""
    fuser = Fuser({"a": np.zeros(3), "b": np.ones(3)})
    turns = np.tile(IDENTITY, (20, 1))
    for n in range(3):
        for sensor in ("a", "b"):
            fuser.update(sensor, [Body(1, standing_person() + 1e-3 * n, np.ones(20), turns)], n * 33_333_333)
        fuser.bodies(n * 33_333_333)


def standing_person() -> Float:
    """Returns (20, 3) metres: a standing person."""
    return Posture(np.array([0.0, 0.95, -2.0]), standing(elbow=0.5), lengths_for_height(1.75)).joints()
