"""Converts an axis to bones: Douglas-Peucker simplification with a cylinder fit as the error (RigMesh)."""

from __future__ import annotations

import itertools

import numpy as np

from enliven.arrays import Float, Int
from enliven.modeling.sketching.axis import Axis

_MIN_JOINT_DISTANCE_RADII = 1.6
"""Minimum distance between two joints of a chain, in radii."""


def simplify_chain(points: Float, radii: Float, tolerance: float, longest: float) -> list[int]:
    """Returns the points of a chain that become joints. The bone between two joints is a cylinder that fits
    the points between them.

    The error at a point is its distance from the bone, plus half the difference between its radius and the
    bone's mean radius. The limit is ``tolerance`` times the mean radius.

    Args:
        points: (P, 2) metres, from one end to the other.
        radii: (P,) metres, half the local width of the shape at each point.
        longest: maximum length of a bone, in mean diameters. Longer bones are split evenly.
    """
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    chosen = _split_chain(points, radii, along, 0, len(points) - 1, tolerance)
    out = [chosen[0]]
    for a, b in itertools.pairwise(chosen):
        mean = float(np.mean(radii[a : b + 1]))
        parts = int(np.ceil((along[b] - along[a]) / max(2 * longest * mean, 1e-12) - 1e-9))
        for k in range(1, min(parts, b - a)):
            middle = int(np.argmin(np.abs(along - (along[a] + (along[b] - along[a]) * k / parts))))
            if out[-1] < middle < b:
                out.append(middle)
        out.append(b)
    return out


def _split_chain(points: Float, radii: Float, along: Float, a: int, b: int, tolerance: float) -> list[int]:
    if b - a < 2:
        return [a, b]
    inner = np.arange(a + 1, b)
    line = points[b] - points[a]
    square = float(line @ line)
    u = np.clip((points[inner] - points[a]) @ line / square, 0, 1) if square > 0 else np.zeros(len(inner))
    away = np.linalg.norm(points[inner] - points[a] - u[:, None] * line, axis=1)
    step = np.gradient(along)[a : b + 1]
    mean = float((radii[a : b + 1] * step).sum() / max(step.sum(), 1e-300))
    error = away + 0.5 * np.abs(radii[inner] - mean)
    worst = int(np.argmax(error))
    if error[worst] <= tolerance * mean:
        return [a, b]
    split_index = int(inner[worst])
    left = _split_chain(points, radii, along, a, split_index, tolerance)
    return left[:-1] + _split_chain(points, radii, along, split_index, b, tolerance)


def bones_from_axis(
    axis: Axis, tolerance: float, longest: float
) -> tuple[Float, Float, list[tuple[int, int]]]:
    """Returns (J, 2) joints and (J,) their radii, both in metres, and the links as pairs of joint numbers.

    Short bones that end inside the circle of a joint are removed.
    """
    number: dict[int, int] = {}
    places: list[Float] = []
    widths: list[float] = []
    links: list[tuple[int, int]] = []
    for chain in axis.chains:
        points, radii = axis.points[chain], axis.radii[chain]
        chosen = _drop_close_joints(points, radii, simplify_chain(points, radii, tolerance, longest))
        for k in chosen:
            if chain[k] not in number:
                number[chain[k]] = len(places)
                places.append(points[k])
                widths.append(float(radii[k]))
        names = [number[chain[k]] for k in chosen]
        links += list(itertools.pairwise(names))
    return np.array(places), np.array(widths), links


def _drop_close_joints(points: Float, radii: Float, chosen: list[int]) -> list[int]:
    """Returns the ``chosen`` joints without those that are closer to the previous joint than the thickness of
    a limb."""
    out = [chosen[0]]
    for k in chosen[1:-1]:
        far = float(np.linalg.norm(points[k] - points[out[-1]]))
        home = float(np.linalg.norm(points[k] - points[chosen[-1]]))
        if min(far, home) > _MIN_JOINT_DISTANCE_RADII * radii[k]:
            out.append(k)
    return [*out, chosen[-1]]


def choose_root_joint(joints: Float, radii: Float, links: list[tuple[int, int]]) -> int:
    """Returns the root joint: the thickest junction. Without a junction, it is the thickest end."""
    degree: Int = np.bincount(np.array(links).ravel(), minlength=len(joints))
    is_branch = degree == degree.max() if degree.max() > 2 else degree == 1
    # If two joints are equally thick, the lower joint is the root.
    order = np.lexsort((joints[:, 1], -np.round(radii / radii.max(), 1), ~is_branch))
    return int(order[0])
