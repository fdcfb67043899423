"""The view-dependent basis of a polyline (AniMesh, sections 5.1 and 5.2). It maps up in the source view to up
in the target view.

    layer.basis = basis_from_views(source_first, target_first, view, up, flip=False)

z points along the first bone at rest. y is perpendicular to z and to the viewing direction, on the side of
the camera's up direction. x is y x z. The paper does not define two cases:

- If a bone is along the viewing direction, every y that is perpendicular to the bone is perpendicular to
  both. The y nearest to up is used. If the bone is also along up, the y nearest to the world's x axis is
  used, or else the y nearest to the z axis.
- A bone that is vertical on the screen: y is horizontal on the screen, and the slightest tilt would flip it
and mirror the motion. If up does not determine the side of y at all, x points away from the viewer. If one of
the two bones is nearly vertical, the target's y is chosen on the side with the smallest rotation from the
source's basis.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Skeleton
from enliven.errors import InputError
from enliven.rotation import canonical, conjugate, from_matrix, multiply

VIEW = np.array([0.0, 0.0, -1.0])
"""(3,) the viewing direction of a camera in front of a person who faces +Z."""
UP = np.array([0.0, 1.0, 0.0])
"""(3,) the up direction of a camera in front of the person."""
MAX_VERTICAL_SINE = math.sin(math.radians(15.0))
"""Sine of the maximum tilt on the screen (15 degrees) of a bone that counts as vertical."""
HALF_TURN = np.array([0.0, 0.0, 0.0, 1.0])
"""(4,) a rotation by 180 degrees about z, which flips y."""
_END_ON_SINE = 1e-4
"""Minimum sine of the angle between a bone and the viewing direction at which the bone defines the side of y.
At smaller angles, the bone is seen end-on."""


def basis_from_views(
    source: AnyArray,
    target: AnyArray,
    view: AnyArray = VIEW,
    up: AnyArray = UP,
    *,
    flip: bool = False,
    source_view: AnyArray | None = None,
    source_up: AnyArray | None = None,
) -> Float:
    """Returns the rotation (4,) from the source's axes to the target's axes, w >= 0. A rotation Q of the
    source becomes basis Q basis^-1 in the target.

    Args:
        source: (3,) the first bone of the source polyline at rest.
        target: (3,) the first bone of the target polyline at rest.
        view: (3,) the viewing direction of the camera onto the target. It also applies to the source, unless
            ``source_view`` is given.
        up: (3,) the up direction of this camera.
        flip: flips the y axis (rotates by 180 degrees about z first).
        source_view: (3,) the viewing direction of the capture device.
        source_up: (3,) the up direction of the capture device.
    """
    view, up = _unit_vector(view, "view"), _unit_vector(up, "up")
    own_view = view if source_view is None else _unit_vector(source_view, "source view")
    own_up = up if source_up is None else _unit_vector(source_up, "source up")
    source_basis, is_source_sure = compute_view_basis(
        _unit_vector(source, "first bone of the source"), own_view, own_up
    )
    target_basis, is_target_sure = compute_view_basis(
        _unit_vector(target, "first bone of the target"), view, up
    )
    basis = multiply(target_basis, conjugate(source_basis))
    flipped = multiply(multiply(target_basis, HALF_TURN), conjugate(source_basis))
    if not (is_source_sure and is_target_sure) and abs(flipped[0]) > abs(basis[0]) + 1e-9:
        basis, flipped = flipped, basis
    return canonical(flipped if flip else basis)


def first_bone(skeleton: Skeleton, chain: tuple[int, ...]) -> Float:
    """Returns the vector (3,) at rest of the first bone in a chain with a non-zero length, or +Y if there is
    no such bone.

    For a chain of one joint, the bone that ends at the joint is used.
    """
    if len(chain) == 1 and skeleton.lengths[chain[0]] > 0.0:
        return np.asarray(skeleton.vectors[chain[0]])
    for a, b in itertools.pairwise(chain):
        vector = skeleton.positions[b] - skeleton.positions[a]
        if np.linalg.norm(vector) > 1e-9:
            return np.asarray(vector)
    return UP


def compute_view_basis(z: Float, view: Float, up: Float) -> tuple[Float, bool]:
    """Returns the basis of a bone as a quaternion, and True if ``up`` determines the side of y.

    Args:
        z: (3,) unit vector along the bone.
        view: (3,) unit vector along the view.
        up: (3,) unit vector that points up.
    """
    y = np.cross(z, view)
    is_sure = True
    if np.linalg.norm(y) < _END_ON_SINE:
        y = _find_nearest_perpendicular(z, up)
    else:
        y = y / np.linalg.norm(y)
        is_sure = abs(float(y @ up)) >= MAX_VERTICAL_SINE
        # The cross product of z and the view direction makes x point away from the viewer. Keep this side if
        # up does not determine one.
        if float(y @ up) < -1e-12:
            y = -y
    return from_matrix(np.stack([np.cross(y, z), y, z], -1)), is_sure


def _find_nearest_perpendicular(z: Float, up: Float) -> Float:
    """Returns the unit vector (3,) perpendicular to ``z`` that is nearest to ``up``, or else to the world's x
    or z.
    """
    for candidate in (up, np.eye(3)[0], np.eye(3)[2]):
        y = candidate - (candidate @ z) * z
        if np.linalg.norm(y) > 1e-3:
            return np.asarray(y / np.linalg.norm(y))
    raise AssertionError("at least one of the three axes is not parallel to z")


def _unit_vector(vector: AnyArray, name: str) -> Float:
    vector = np.asarray(vector, np.float64)
    length = float(np.linalg.norm(vector)) if vector.shape == (3,) else math.nan
    if not (math.isfinite(length) and length > 0.0):
        raise InputError(
            f"{vector} is not a direction",
            where=name,
            remedy="Pass three finite numbers that are not all zero.",
        )
    return np.asarray(vector / length)
