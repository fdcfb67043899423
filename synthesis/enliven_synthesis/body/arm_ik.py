"""Two-bone inverse kinematics of an arm: shoulder, elbow and wrist."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_synthesis.body.performer import Performer


def solve_arm(
    performer: Performer, chest: Float, target: Float, out: Float, side: int
) -> tuple[Float, float]:
    """Returns the (3, 3) world_from_upper_arm and the elbow's bend in radians that bring the wrist to a
    target.

    Args:
        chest: (3, 3) world_from_chest.
        target: (3,) target of the wrist in metres, chest's frame. A target out of reach is moved within
            reach.
        out: (3,) the direction in which the elbow points, chest's frame.
        side: 0 the left arm, 1 the right one.
    """
    shoulder = performer.shoulder * np.array([1.0 - 2.0 * side, 1.0, 1.0])
    to_target = np.asarray(target) - shoulder
    a, b = performer.upper_arm, performer.forearm
    distance = float(np.clip(np.linalg.norm(to_target), 0.35 * (a + b), 0.995 * (a + b)))
    along = to_target / (float(np.linalg.norm(to_target)) + 1e-9)
    bend = float(np.arccos(np.clip((distance**2 - a**2 - b**2) / (2 * a * b), -1, 1)))
    inner = float(np.arccos(np.clip((distance**2 + a**2 - b**2) / (2 * a * distance), -1, 1)))
    outward = out - (out @ along) * along
    outward /= float(np.linalg.norm(outward)) + 1e-9
    upper = np.cos(inner) * along + np.sin(inner) * outward
    fore = (distance * along - a * upper) / b
    y = -upper
    z = fore - (fore @ upper) * upper
    z /= float(np.linalg.norm(z)) + 1e-9
    return chest @ np.stack([np.cross(y, z), y, z], 1), bend
