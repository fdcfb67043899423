"""The view-dependent basis of a polyline (AniMesh, sections 5.1 and 5.2): up stays up from source to target.

    layer.basis = basis_from_views(source_first, target_first, view, up, flip=False)

z points along the first bone at rest; y is perpendicular to z and to the viewing direction, on the side of
the camera's up; x = y x z. The paper leaves two cases open:

- A bone along the viewing direction: every y perpendicular to the bone is perpendicular to both. The y
  nearest to up is used. If the bone is along up as well, the y nearest to the world's x is used, else z.
- A bone that is vertical on the screen: y is horizontal on the screen, and the slightest tilt would flip it
  and mirror the motion. If up does not determine the side at all, x points away from the viewer. If one bone
  of a pair is nearly vertical, the target's y uses the side that rotates the source's basis least.
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
"""(3,) the viewing direction of a camera in front of a person that faces +Z."""
UP = np.array([0.0, 1.0, 0.0])
"""(3,) the up direction of that camera."""
MAX_VERTICAL_SINE = math.sin(math.radians(15.0))
"""Sine of the tilt on the screen within which a bone counts as vertical."""
HALF_TURN = np.array([0.0, 0.0, 0.0, 1.0])
"""(4,) a rotation by 180 degrees about z, which flips y."""
_END_ON_SINE = 1e-4
"""Sine between a bone and the viewing direction below which the bone is end-on and does not define a side."""


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
    """Returns (4,) target_from_source, w >= 0: a rotation Q of the source becomes basis Q basis^-1 in the
    target.

    Args:
        source: (3,) the first bone of the source polyline at rest.
        target: (3,) that of the target.
        view: (3,) the viewing direction onto the target, and onto the source unless that has its own.
        up: (3,) the camera's up.
        flip: flips the y axis (rotates by 180 degrees about z first).
        source_view: (3,) the capture device's viewing direction.
        source_up: (3,) its up.
    """
    view, up = _unit_vector(view, "view"), _unit_vector(up, "up")
    own_view = view if source_view is None else _unit_vector(source_view, "source view")
    own_up = up if source_up is None else _unit_vector(source_up, "source up")
    source_basis, is_source_sure = _view_basis(
        _unit_vector(source, "first bone of the source"), own_view, own_up
    )
    target_basis, is_target_sure = _view_basis(_unit_vector(target, "first bone of the target"), view, up)
    basis = multiply(target_basis, conjugate(source_basis))
    turned = multiply(multiply(target_basis, HALF_TURN), conjugate(source_basis))
    if not (is_source_sure and is_target_sure) and abs(turned[0]) > abs(basis[0]) + 1e-9:
        basis, turned = turned, basis
    return canonical(turned if flip else basis)


def first_bone(skeleton: Skeleton, chain: tuple[int, ...]) -> Float:
    """Returns (3,) the first bone of a chain at rest that has a length; up if no bone has one.

    For a chain of one joint, it is the bone that ends there.
    """
    if len(chain) == 1 and skeleton.lengths[chain[0]] > 0.0:
        return np.asarray(skeleton.vectors[chain[0]])
    for a, b in itertools.pairwise(chain):
        vector = skeleton.positions[b] - skeleton.positions[a]
        if np.linalg.norm(vector) > 1e-9:
            return np.asarray(vector)
    return UP


def _view_basis(z: Float, view: Float, up: Float) -> tuple[Float, bool]:
    """Returns the basis for unit vectors, and True if ``up`` determined the side of y."""
    y = np.cross(z, view)
    is_sure = True
    if np.linalg.norm(y) < _END_ON_SINE:
        y = _nearest_perpendicular(z, up)
    else:
        y = y / np.linalg.norm(y)
        is_sure = abs(float(y @ up)) >= MAX_VERTICAL_SINE
        # The cross product of z and the view direction makes x point away from the viewer. Keep this side if
        # up does not determine one.
        if float(y @ up) < -1e-12:
            y = -y
    return from_matrix(np.stack([np.cross(y, z), y, z], -1)), is_sure


def _nearest_perpendicular(z: Float, up: Float) -> Float:
    """Returns (3,) the unit vector perpendicular to ``z`` nearest to ``up``, or else to the world's x or
    z.
    """
    for candidate in (up, np.eye(3)[0], np.eye(3)[2]):
        y = candidate - (candidate @ z) * z
        if np.linalg.norm(y) > 1e-3:
            return np.asarray(y / np.linalg.norm(y))
    raise AssertionError("one of three axes is at right angles enough")


def _unit_vector(vector: AnyArray, name: str) -> Float:
    vector = np.asarray(vector, np.float64)
    length = float(np.linalg.norm(vector)) if vector.shape == (3,) else math.nan
    if not (math.isfinite(length) and length > 0.0):
        raise InputError(f"{vector} is not a direction", where=name, mend="Give three numbers, not all zero.")
    return np.asarray(vector / length)
