"""Strokes for sketching parts: outlines of a tentacle, a mantis's leg, a torso, a star and a hand.

Each is a closed outline (N, 2) in metres, similar to an artist's drawing. They are used in demonstrations and
measurements.
"""

from __future__ import annotations

import itertools

import numpy as np
from manifold3d import CrossSection, OpType

from enliven.arrays import Float


def ribbon(path: Float, half_widths: Float) -> Float:
    """Returns (2 P, 2) the outline of a ribbon along a path (P, 2) with half widths (P,)."""
    ahead = np.gradient(path, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    left = np.stack([-ahead[:, 1], ahead[:, 0]], 1) * half_widths[:, None]
    return np.concatenate([path + left, (path - left)[::-1]])


def limb(joints: Float, half_widths: Float) -> Float:
    """Returns (N, 2) the outline of segments between joints (J, 2), round at each joint."""
    circles = [
        CrossSection.circle(float(r), 40).translate((float(x), float(y)))
        for (x, y), r in zip(joints, half_widths, strict=True)
    ]
    pieces = [CrossSection.batch_hull(list(pair)) for pair in itertools.pairwise(circles)]
    whole = CrossSection.batch_boolean(pieces, OpType.Add)
    return np.array(max(whole.to_polygons(), key=len), np.float64)


def tentacle(length: float = 1.4, width: float = 0.26, sway: float = 0.18) -> Float:
    """Returns an upright, swaying tentacle with a thick base."""
    s = np.linspace(0, 1, 60)
    path = np.stack([sway * np.sin(5 * s) * s, length * s], 1)
    return ribbon(path, width / 2 * (1 - 0.92 * s))


def mantis_leg() -> Float:
    """Returns the folded foreleg of a mantis: coxa, femur, tibia and foot, with their angles."""
    joints = np.array([[0.0, 0.0], [-0.16, -0.42], [0.5, -0.02], [0.24, -0.52], [0.36, -0.66]])
    return limb(joints, np.array([0.075, 0.07, 0.055, 0.035, 0.025]))


def torso() -> Float:
    """Returns a torso with shoulders and a waist."""
    right = [
        (0.20, -0.40),
        (0.21, -0.25),
        (0.17, -0.05),
        (0.22, 0.15),
        (0.29, 0.33),
        (0.22, 0.43),
        (0.07, 0.46),
    ]
    half = np.array(right)
    return np.concatenate([half, half[::-1] * [-1, 1]])


def star(arms: int = 5) -> Float:
    """Returns a starfish."""
    angle = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    return np.stack([np.sin(angle), np.cos(angle)], 1) * (0.35 + 0.2 * np.cos(arms * angle))[:, None]


def hand() -> Float:
    """Returns a hand with four fingers and a thumb."""
    points = [(-0.35, -0.5), (-0.42, 0.1)]
    for x, length, half in ((-0.30, 0.55, 0.09), (-0.10, 0.75, 0.09), (0.10, 0.75, 0.09), (0.30, 0.6, 0.085)):
        turn = np.linspace(np.pi, 0, 9)
        points += [(x - half, 0.12), *zip(x + half * np.cos(turn), length + half * np.sin(turn), strict=True)]
        points += [(x + half, 0.12)]
    points += [(0.42, 0.0), (0.62, 0.16), (0.72, 0.05), (0.45, -0.3), (0.35, -0.5)]
    return np.array(points, np.float64)
