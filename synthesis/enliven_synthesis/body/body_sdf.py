"""The performer's body surface as a signed distance function (SDF).

It is a smooth union of tapered capsules and ellipsoids.

It is deliberately richer than a tracker's capsule model: muscles, buttocks, a jaw, sleeves, trouser hems and
shoes. A tracker that is tested on it must therefore handle shapes that its own model does not contain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int
from enliven.person import Limb
from enliven_synthesis.body.performer import Figure, Performer

GROUP_BLEND_WIDTHS_M = (0.055, 0.022, 0.028, 0.028, 0.036, 0.036)
"""Width in metres of the smooth union within each group: trunk, head, left and right arm, left and right
leg."""
BLEND_BETWEEN_GROUPS_M = 0.014
"""Width in metres of the smooth union between the groups."""
TAPER = 0
"""Kind of a tapered capsule. Its radius changes linearly along its axis, plus a bulge half-way."""
ELLIPSOID = 1
"""Kind of an ellipsoid."""
ORDINARY = 0
"""Material of skin and clothes, which reflect the sensor's light."""
DARK = 1
"""Material of hair and shoes, which absorb most of the light."""

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class BodyPiece:
    """One primitive of the body, in metres, for the left side of an average build of 1.75 m.

    A taper runs from ``a`` in frame ``limb`` to ``b`` in frame ``other``. Its radius goes from ``ra`` to
    ``rb``, plus ``bulge`` half-way. An ellipsoid has its centre at ``a`` and the half axes ``b``.
    """

    group: int
    kind: int
    limb: Limb
    a: Triple
    b: Triple
    other: Limb = Limb.PELVIS
    ra: float = 0.0
    rb: float = 0.0
    bulge: float = 0.0
    material: int = ORDINARY


def _make_ellipsoid(group: int, limb: Limb, a: Triple, b: Triple, material: int = 0) -> BodyPiece:
    return BodyPiece(group, ELLIPSOID, limb, a, b, limb, material=material)


def _make_taper(
    group: int,
    limb: Limb,
    a: Triple,
    other: Limb,
    b: Triple,
    radii: Triple,
    material: int = 0,
) -> BodyPiece:
    return BodyPiece(group, TAPER, limb, a, b, other, *radii, material)


_CHEST, _SKULL, _PELVIS = Limb.CHEST, Limb.SKULL, Limb.PELVIS
_TRUNK = (
    _make_ellipsoid(0, _PELVIS, (0.0, -0.035, 0.0), (0.158, 0.12, 0.112)),
    _make_ellipsoid(0, Limb.ABDOMEN, (0.0, -0.01, 0.01), (0.147, 0.16, 0.106)),
    _make_ellipsoid(0, _CHEST, (0.0, -0.175, 0.004), (0.160, 0.195, 0.116)),
    _make_taper(0, _CHEST, (-0.12, -0.04, -0.012), _CHEST, (0.12, -0.04, -0.012), (0.056, 0.056, 0.004)),
)
_HEAD = (
    _make_taper(1, _CHEST, (0.0, 0.0, -0.012), _SKULL, (0.0, -0.05, -0.012), (0.064, 0.056, -0.003)),
    _make_ellipsoid(1, _SKULL, (0.0, 0.012, -0.004), (0.074, 0.102, 0.094)),
    _make_ellipsoid(1, _SKULL, (0.0, -0.060, 0.030), (0.052, 0.062, 0.062)),
    _make_taper(1, _SKULL, (0.0, 0.005, 0.088), _SKULL, (0.0, -0.032, 0.104), (0.010, 0.016, 0.0)),
    _make_ellipsoid(1, _SKULL, (0.0, 0.038, -0.022), (0.080, 0.082, 0.090), DARK),
)
_TRUNK_SIDE = (
    _make_ellipsoid(0, _PELVIS, (0.074, -0.085, -0.045), (0.084, 0.088, 0.080)),
    _make_ellipsoid(0, _CHEST, (0.072, -0.125, 0.066), (0.074, 0.062, 0.042)),
    _make_taper(0, _CHEST, (0.105, -0.032, -0.02), _CHEST, (0.022, 0.075, -0.014), (0.046, 0.044, 0.0)),
    _make_ellipsoid(0, Limb.UPPER_ARM_LEFT, (0.0, -0.004, 0.0), (0.060, 0.060, 0.060)),
    _make_ellipsoid(0, Limb.THIGH_LEFT, (0.0, -0.035, 0.0), (0.084, 0.100, 0.088)),
)
_EAR = (_make_ellipsoid(1, _SKULL, (0.077, -0.012, -0.006), (0.012, 0.030, 0.020)),)
_U, _F, _H = Limb.UPPER_ARM_LEFT, Limb.FOREARM_LEFT, Limb.HAND_LEFT
_ARM = (
    _make_taper(2, _U, (0.0, -0.005, 0.0), _F, (0.0, 0.0, 0.0), (0.052, 0.040, 0.005)),
    _make_ellipsoid(2, _U, (0.012, -0.045, 0.0), (0.052, 0.085, 0.056)),
    _make_taper(2, _U, (0.002, -0.03, 0.0), _U, (0.006, -0.165, 0.0), (0.062, 0.067, 0.0)),
    _make_taper(2, _F, (0.0, 0.0, 0.0), _H, (0.0, 0.0, 0.0), (0.041, 0.027, 0.003)),
    _make_ellipsoid(2, _F, (0.008, -0.065, 0.003), (0.040, 0.088, 0.043)),
    _make_ellipsoid(2, _H, (0.0, -0.052, 0.002), (0.020, 0.058, 0.043)),
    _make_taper(2, _H, (-0.002, -0.085, 0.018), _H, (-0.018, -0.172, 0.018), (0.018, 0.011, 0.0)),
    _make_taper(2, _H, (-0.002, -0.085, -0.014), _H, (-0.018, -0.162, -0.014), (0.018, 0.011, 0.0)),
    _make_taper(2, _H, (-0.004, -0.022, 0.030), _H, (-0.012, -0.088, 0.060), (0.016, 0.011, 0.0)),
)
_T, _S, _A = Limb.THIGH_LEFT, Limb.SHANK_LEFT, Limb.FOOT_LEFT
_LEG = (
    _make_taper(4, _T, (0.0, -0.03, 0.0), _S, (0.0, 0.01, 0.0), (0.087, 0.056, 0.006)),
    _make_ellipsoid(4, _T, (0.004, -0.19, 0.024), (0.064, 0.165, 0.058)),
    _make_ellipsoid(4, _S, (0.0, 0.0, 0.010), (0.042, 0.060, 0.048)),
    _make_taper(4, _S, (0.0, 0.0, 0.0), _A, (0.0, 0.03, -0.008), (0.055, 0.044, 0.0)),
    _make_ellipsoid(4, _S, (0.0, -0.135, -0.028), (0.050, 0.125, 0.050)),
    _make_taper(4, _S, (0.0, -0.12, -0.002), _S, (0.0, -0.385, -0.004), (0.056, 0.063, 0.0)),
    _make_taper(4, _A, (0.0, -0.036, -0.03), _A, (0.0, -0.052, 0.125), (0.042, 0.030, 0.004), DARK),
    _make_ellipsoid(4, _A, (0.006, -0.058, 0.055), (0.044, 0.026, 0.135), DARK),
)


def _mirror_piece(piece: BodyPiece) -> BodyPiece:
    """Returns the mirrored piece for the right side.

    X is negated, limbs become the right ones, and arms and legs move to the next group.
    """
    flip = lambda v: (-v[0], v[1], v[2])  # noqa: E731
    paired = lambda limb: Limb(limb + 1) if limb >= Limb.UPPER_ARM_LEFT else limb  # noqa: E731
    b = flip(piece.b) if piece.kind == TAPER else piece.b
    group = piece.group + 1 if piece.group >= 2 else piece.group
    return BodyPiece(
        group, piece.kind, paired(piece.limb), flip(piece.a), b, paired(piece.other),
        piece.ra, piece.rb, piece.bulge, piece.material,
    )  # fmt: skip


PIECES: tuple[BodyPiece, ...] = tuple(
    sorted(
        _TRUNK + _HEAD + tuple(q for p in _TRUNK_SIDE + _EAR + _ARM + _LEG for q in (p, _mirror_piece(p))),
        key=lambda piece: piece.group,
    )
)
"""All pieces of the body, ordered by group."""


@dataclass(frozen=True)
class BodySdf:
    """The primitives of a posed body in one frame of reference, in the layout that the renderer needs.

    Attributes:
        shape: (P, 16) float64. A taper: a (0:3), b - a (3:6), 1/|b - a|^2 (6), ra (7), rb - ra (8), bulge
            (9). An ellipsoid: centre (0:3), its axes over their half lengths
            (3:12, row by row), 1 / half lengths (12:15).
        kind, group, material: (P,) int64.
        hull: (P, 7) float64, the two ends and the radius of a bounding capsule of each primitive.
    """

    shape: Float
    kind: Int
    group: Int
    material: Int
    hull: Float


class BodyAnatomy:
    """The pieces of one performer's body. They are scaled to the build once and posed for every figure."""

    def __init__(self, performer: Performer) -> None:
        thick = performer.scale * performer.proportions.girth
        self._limb = np.array([p.limb for p in PIECES])
        self._other = np.array([p.other for p in PIECES])
        self._a = np.array([p.a for p in PIECES]) * [_limb_scale(performer, p.limb) for p in PIECES]
        self._b = np.array([p.b for p in PIECES]) * [_limb_scale(performer, p.other) for p in PIECES]
        self._kind = np.array([p.kind for p in PIECES], dtype=np.int64)
        self._group = np.array([p.group for p in PIECES], dtype=np.int64)
        self._material = np.array([p.material for p in PIECES], dtype=np.int64)
        radii = np.array([(p.ra, p.rb - p.ra, p.bulge) for p in PIECES]) * thick
        self._taper = np.flatnonzero(self._kind == TAPER)
        self._round = np.flatnonzero(self._kind == ELLIPSOID)
        self._radii = radii[self._taper]
        self._half = np.array([_half_axes(performer, PIECES[i]) for i in self._round])
        order = np.sort(self._half, axis=1)
        self._longest = np.argmax(self._half, axis=1)
        self._core, middle = order[:, 2] - order[:, 1], order[:, 1]
        self._girth = np.empty(len(PIECES))
        first, change, bulge = self._radii.T
        self._girth[self._taper] = np.maximum(first, first + change) + np.maximum(bulge, 0.0)
        self._girth[self._round] = middle

    def place(self, figure: Figure, camera_from_world: Float) -> BodySdf:
        """Returns the primitives of a figure in the camera's frame; ``camera_from_world`` is (4, 4)."""
        frames = _multiply(camera_from_world[None, :3, :3], figure.frames)
        frames[:, :, 3] += camera_from_world[:3, 3]
        shape, hull = np.zeros((len(PIECES), 16)), np.zeros((len(PIECES), 7))
        a = _multiply(frames[self._limb, :, :3], self._a[:, :, None])[:, :, 0] + frames[self._limb, :, 3]
        b = _multiply(frames[self._other, :, :3], self._b[:, :, None])[:, :, 0] + frames[self._other, :, 3]
        shape[:, 0:3], hull[:, 0:3], hull[:, 3:6], hull[:, 6] = a, a, b, self._girth
        t, e = self._taper, self._round
        along = b[t] - a[t]
        shape[t, 3:6], shape[t, 7:10] = along, self._radii
        shape[t, 6] = 1.0 / (
            along[:, 0] * along[:, 0] + along[:, 1] * along[:, 1] + along[:, 2] * along[:, 2]
        )
        axes = frames[self._limb[e], :, :3]
        shape[e, 3:12] = (axes / self._half[:, None, :]).transpose(0, 2, 1).reshape(-1, 9)
        shape[e, 12:15] = 1.0 / self._half
        axis = axes[np.arange(len(e)), :, self._longest] * self._core[:, None]
        hull[e, 0:3], hull[e, 3:6] = a[e] - axis, a[e] + axis
        return BodySdf(shape, self._kind, self._group, self._material, hull)


def _multiply(a: Float, b: Float) -> Float:
    """Returns the product of (..., 3, 3) and (..., 3, n).

    The order of additions is fixed (no BLAS, no fused multiply-add), so that all machines give the same
    result.
    """
    return np.asarray(
        a[..., :, 0, None] * b[..., None, 0, :]
        + a[..., :, 1, None] * b[..., None, 1, :]
        + a[..., :, 2, None] * b[..., None, 2, :]
    )


def _limb_scale(performer: Performer, limb: Limb) -> Triple:
    """Returns the scale factors of a limb in width, length and depth, relative to the reference build."""
    s, p = performer.scale, performer.proportions
    width = p.shoulders if limb == Limb.CHEST else p.hips if limb == Limb.PELVIS else p.girth
    return s * width, s * _compute_relative_length(performer, limb), s * p.girth


def _half_axes(performer: Performer, piece: BodyPiece) -> Triple:
    """Returns the half axes of an ellipsoid in metres. The head does not grow with girth."""
    s, g = performer.scale, performer.proportions.girth
    if piece.limb == Limb.SKULL:
        return piece.b[0] * s, piece.b[1] * s, piece.b[2] * s
    return (
        piece.b[0] * s * g,
        piece.b[1] * s * _compute_relative_length(performer, piece.limb),
        piece.b[2] * s * g,
    )


def _compute_relative_length(performer: Performer, limb: Limb) -> float:
    """Returns the length of a limb relative to the reference build."""
    if Limb.UPPER_ARM_LEFT <= limb <= Limb.HAND_RIGHT:
        return performer.proportions.arms
    if Limb.THIGH_LEFT <= limb <= Limb.SHANK_RIGHT:
        return performer.proportions.legs
    return 1.0
