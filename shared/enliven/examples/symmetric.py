"""Mirrors examples at the mesh's symmetry plane, so that an example for the left side also applies to the
right side (section 6.1).

partners = find_partners(rest (P, 3), point, normal)         # (P,) each point's mirror image on the mesh
more = add_mirror_images(examples, partners, rest, normal)           # each example, and its mirror image
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float, Int
from enliven.errors import InputError
from enliven.examples.poses import Examples

_SELF_MIRROR_TOLERANCE = 1e-3
"""Maximum difference between a symmetric pose and its mirror image, as a fraction of the pose's size."""


def find_partners(
    rest: Float, point: Float, normal: Float, tolerance: float = 0.1, names: Sequence[str] | None = None
) -> tuple[int, ...]:
    """Returns the number of the mirror image of each control point (P, 3) at rest. A point on the plane has
    its own number.

    Args:
        point, normal: (3,) a point on the mesh's symmetry plane, and its normal.
        tolerance: maximum error of a mirror image, as a fraction of the points' extent.
        names: (P,) names of the control points, for messages. If None, messages contain their numbers.

    Raises:
        InputError: if a control point has no mirror image; the message names it.
    """
    rest = np.asarray(rest, np.float64)
    distances = np.linalg.norm(reflect_points(rest, point, normal)[:, None] - rest[None], axis=2)
    nearest = distances.argmin(1)
    extent = float(np.linalg.norm(np.ptp(rest, axis=0)))
    for p, other in enumerate(nearest):
        if distances[p, other] > tolerance * extent or nearest[other] != p:
            advice = "Add a control point at the mirrored position, or turn symmetry off."
            point_name = p if names is None else repr(names[p])
            raise InputError(
                f"control point {point_name} has no mirror image", where="symmetry", remedy=advice
            )
    return tuple(int(other) for other in nearest)


def reflect_points(places: Float, point: Float, normal: Float) -> Float:
    """Mirrors positions (..., 3) in a plane."""
    unit_normal = np.asarray(normal, np.float64) / np.linalg.norm(normal)
    return np.asarray(places - 2.0 * ((places - point) @ unit_normal)[..., None] * unit_normal)


def mirror_places(places: Float, rest: Float, partners: Sequence[int], normal: Float) -> Float:
    """Mirrors positions (..., P, 3) of control points.

    Each point moves from its rest position in ``rest`` (P, 3) by the reflected displacement of its partner.
    So the rest pose is its own mirror image even if the mesh is not exactly symmetric.
    """
    order = list(partners)
    return np.asarray(rest + reflect_points(places[..., order, :] - rest[order], np.zeros(3), normal))


def add_mirror_images(
    examples: Examples,
    partners: Sequence[int],
    rest: Float,
    normal: Float,
    across: Float | None = None,
) -> Examples:
    """Returns the examples and their mirror images, without mirror images that equal an example.

    Args:
        partners: (P,) the mirror image of each control point. The paired joints are assumed to be mirror
            images in the same way.
        rest: (P, 3) metres, the control points at rest.
        normal: (3,) the normal of the mesh's symmetry plane.
        across: (3,) the performer's left-right axis in the body frame. If None, it is computed from the
            joints.

    Raises:
        InputError: if ``partners`` is not symmetric.
    """
    order = np.asarray(partners)
    if sorted(order) != list(range(len(examples.points))) or (order[order] != np.arange(len(order))).any():
        raise InputError(
            f"the partners {tuple(partners)} are not mutual: each partner must have the first point "
            "as its partner",
            where="symmetry",
        )
    axis = _compute_left_right_axis(examples, order) if across is None else np.asarray(across, np.float64)
    sources = reflect_points(examples.sources[:, order], np.zeros(3), axis)
    targets = mirror_places(examples.targets, np.asarray(rest, np.float64), list(order), normal)
    all_sources, all_targets = list(examples.sources), list(examples.targets)
    for source, target in zip(sources, targets, strict=True):
        distances = [np.sqrt(((source - earlier) ** 2).sum(1).mean()) for earlier in all_sources]
        if min(distances) > _SELF_MIRROR_TOLERANCE * examples.source_size:
            all_sources.append(source)
            all_targets.append(target)
    return Examples(examples.joints, examples.points, np.array(all_sources), np.array(all_targets))


def _compute_left_right_axis(examples: Examples, order: Int) -> Float:
    """Computes the horizontal unit vector (3,) from right joints to left joints, averaged over all
    examples."""
    offsets = examples.sources - examples.sources[:, order]
    left = np.arange(len(order)) < order
    horizontal = offsets[:, left].reshape(-1, 3) * [1.0, 0.0, 1.0]
    if len(horizontal) == 0 or not horizontal.any():
        advice = "Pass the performer's left-right axis."
        raise InputError(
            "no joint has a partner on the other side of the body", where="symmetry", remedy=advice
        )
    return np.asarray(np.linalg.eigh(horizontal.T @ horizontal)[1][:, -1])
