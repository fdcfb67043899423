"""A desk lamp as large as a person: a base, two arms with springs, and a shade. Each is a closed shell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int32
from enliven.meshes import Mesh

_ENAMEL_COLOUR = (233, 226, 208)
"""sRGB of the enamel, 0..255: base, bars and the outside of the shade."""
_SPRING_COLOUR = (158, 164, 170)
"""sRGB of the springs, 0..255."""
_PIN_COLOUR = (74, 78, 86)
"""sRGB of the pins, 0..255."""
_SHADE_INSIDE_COLOUR = (250, 236, 200)
"""sRGB of the inside of the shade, 0..255."""
_BULB_COLOUR = (255, 221, 130)
"""sRGB of the bulb, 0..255."""
_FOOT = np.array([-0.11, 0.44, 0.0])
"""Position in metres of the joint of the lower arm on the post."""
_ELBOW = np.array([-0.17, 1.40, 0.0])
"""Position in metres of the joint of both arms, at a person's shoulder."""
_HEAD = np.array([-0.80, 1.51, 0.0])
"""Position in metres of the joint of the shade."""
_SHADE_DIRECTION = np.array([-0.8, -0.6, 0.0])
"""Unit direction in which the shade opens."""
_PIN_AXIS = np.array([0.0, 0.0, 1.0])
"""Direction of the pins, the axes of all joints."""
_SPRING_END = 0.48
"""Position along an arm at which its springs end, as a fraction of the arm's length."""


@dataclass(frozen=True)
class _Shell:
    """One closed surface.

    Attributes:
        vertices: (V, 3) metres.
        faces: (F, 3) outward.
        colours: (V, 3) sRGB.
    """

    vertices: Float
    faces: Int32
    colours: Float


def make_lamp(cell: float = 0.016) -> Mesh:
    """Creates a sprung lamp 1.7 m tall that a standing person can possess with "hip and right arm".

    It stands on y = 0 and reaches to the right. Consider a person that stands at the origin and faces +Z,
    with the right arm held out to the side. The hip is next to the lamp's lower arm. The shoulder is at the
    lamp's elbow at 1.4 m. The arm is inside the lamp's upper arm, and the hand is at the shade. The lamp has
    eighteen closed shells, each overlapping its neighbours, with vertex colours.

    Args:
        cell: approximate length of the longest edge in metres.
    """
    shells = [
        _make_base(cell),
        *_make_arm(_FOOT, _ELBOW, cell),
        *_make_arm(_ELBOW, _HEAD, cell),
        *_make_joints(cell),
        *_make_shade(cell),
    ]
    starts = np.cumsum([0, *(len(shell.vertices) for shell in shells)])
    vertices = np.concatenate([shell.vertices for shell in shells])
    faces = np.concatenate([s.faces + start for s, start in zip(shells, starts, strict=False)])
    colours = np.concatenate([shell.colours for shell in shells]).astype(np.uint8)
    vertices[:, 1] -= vertices[:, 1].min()
    return Mesh(vertices, faces.astype(np.int32), "lamp", colours)


def _make_base(cell: float) -> _Shell:
    """Returns the base: a heavy foot that continues upward as a post."""
    profile = [(0.0, 0.0), (0.228, 0.0), (0.242, 0.010), (0.244, 0.024), (0.226, 0.036), (0.150, 0.052)]
    profile += [
        (0.078, 0.072),
        (0.048, 0.100),
        (0.036, 0.160),
        (0.031, 0.400),
        (0.036, 0.412),
        (0.036, 0.436),
    ]
    profile += [(0.026, 0.448), (0.0, 0.450)]
    at = np.array([_FOOT[0], 0.0, _FOOT[2]])
    return _paint(_revolve(np.array(profile), at, np.array([0.0, 1.0, 0.0]), cell), _ENAMEL_COLOUR)


def _make_arm(start: Float, end: Float, cell: float) -> list[_Shell]:
    """Returns an arm: two parallel bars, two springs, and a pin.

    The springs are on both sides near the arm's lower end, and the pin holds both.
    """
    along = (end - start) / np.linalg.norm(end - start)
    apart = np.cross(_PIN_AXIS, along)
    bars = [_make_bar(start + s * 0.030 * apart, end + s * 0.030 * apart, cell) for s in (-1.0, 1.0)]
    hook = start + (_SPRING_END * (end - start)) + 0.030 * apart
    pin = [(0.0, -0.050), (0.008, -0.048), (0.008, 0.048), (0.0, 0.050)]
    held = _paint(_revolve(np.array(pin), hook, _PIN_AXIS, cell), _PIN_COLOUR)
    springs = (_make_spring(start, hook, s * 0.042 * _PIN_AXIS) for s in (-1.0, 1.0))
    return [*bars, held, *springs]


def _make_bar(start: Float, end: Float, cell: float) -> _Shell:
    """Returns a round bar."""
    return _paint(_make_tube(start, end, np.array([[0.0, 0.013], [1.0, 0.013]]), cell), _ENAMEL_COLOUR)


def _make_spring(start: Float, end: Float, beside: Float) -> _Shell:
    """Returns a tension spring with touching coils between two hooks. It is a tube with a helical groove."""
    length = float(np.linalg.norm(end - start))
    pitch, around, coil = 0.016, 14, 0.020
    rings = int(length / pitch * 5)
    t = np.linspace(0.0, 1.0, rings)[:, None]
    angle = np.arange(around) / around * 2 * np.pi
    inside = np.clip(np.minimum(t - 0.14, 0.86 - t) / 0.02, 0.0, 1.0)
    wound = coil - 0.0045 + 0.0045 * np.abs(np.cos(np.pi * t * length / pitch + 0.5 * angle)) ** 0.7
    radius = 0.005 + inside * (wound - 0.005)
    return _paint(_make_rings(start + beside, end + beside, t[:, 0], radius), _SPRING_COLOUR)


def _make_joints(cell: float) -> list[_Shell]:
    """Returns the pins about which the arms turn, and the plates next to the bars at the elbow."""
    pin = [(0.0, -0.036), (0.030, -0.036), (0.036, -0.030), (0.036, 0.030), (0.030, 0.036), (0.0, 0.036)]
    plate = [(0.0, -0.006), (0.058, -0.006), (0.062, 0.0), (0.058, 0.006), (0.0, 0.006)]
    shells = [
        _paint(_revolve(np.array(pin), at, _PIN_AXIS, cell), _PIN_COLOUR) for at in (_FOOT, _ELBOW, _HEAD)
    ]
    for side in (-0.024, 0.024):
        shells.append(
            _paint(_revolve(np.array(plate), _ELBOW + side * _PIN_AXIS, _PIN_AXIS, cell), _ENAMEL_COLOUR)
        )
    return shells


def _make_shade(cell: float) -> list[_Shell]:
    """Returns the shade with its socket, open at the front, and the bulb in it."""
    outer = [(0.0, -0.052), (0.040, -0.052), (0.050, -0.042), (0.052, 0.060), (0.066, 0.086), (0.110, 0.130)]
    outer += [(0.150, 0.190), (0.172, 0.262), (0.178, 0.300)]
    inner = [(0.172, 0.300), (0.165, 0.262), (0.143, 0.194), (0.104, 0.138), (0.060, 0.096), (0.030, 0.090)]
    outer, inner = _round_profile(outer), [*_round_profile(inner), (0.0, 0.090)]
    shade = _revolve(np.array(outer + inner), _HEAD, _SHADE_DIRECTION, cell)
    inside = _make_inner_side(shade[0], np.array(inner))
    painted = np.where(inside[:, None], _SHADE_INSIDE_COLOUR, _ENAMEL_COLOUR).astype(np.float64)
    bulb = [(0.0, 0.070), (0.020, 0.074), (0.024, 0.110), (0.044, 0.150), (0.052, 0.180), (0.044, 0.210)]
    bulb += [(0.024, 0.228), (0.0, 0.232)]
    light = _revolve(np.array(_round_profile(bulb)), _HEAD, _SHADE_DIRECTION, cell)
    return [_Shell(*shade, painted), _paint(light, _BULB_COLOUR)]


def _round_profile(profile: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Returns the profile with its corners cut twice (Chaikin). The ends stay unchanged."""
    points = np.array(profile)
    for _ in range(2):
        cut = np.stack([0.75 * points[:-1] + 0.25 * points[1:], 0.25 * points[:-1] + 0.75 * points[1:]], 1)
        points = np.concatenate([points[:1], cut.reshape(-1, 2)[1:-1], points[-1:]])
    return [(float(r), float(h)) for r, h in points]


def _make_inner_side(vertices: Float, inner: Float) -> Bool:
    """Returns (V,) flags: True for each point of the shade that is on its inner side."""
    along = (vertices - _HEAD) @ _SHADE_DIRECTION
    radius = np.linalg.norm(vertices - _HEAD - along[:, None] * _SHADE_DIRECTION, axis=1)
    middle = np.interp(along, inner[::-1, 1], inner[::-1, 0] + 0.003, left=-1.0, right=-1.0)
    return np.asarray((radius < middle) & (along > inner[-1, 1] - 1e-6))


def _paint(surface: tuple[Float, Int32], colour: tuple[int, int, int]) -> _Shell:
    vertices, faces = surface
    return _Shell(vertices, faces, np.broadcast_to(np.array(colour, np.float64), vertices.shape))


def _revolve(profile: Float, at: Float, axis: Float, cell: float) -> tuple[Float, Int32]:
    """Returns a closed surface of revolution.

    Args:
        profile: (P, 2) radius and height along ``axis``. It begins and ends on the axis, with the outside on
            its right.
        at: (3,) the position of height 0.
    """
    steps = np.linalg.norm(np.diff(profile, axis=0), axis=1)
    counts = np.maximum(np.ceil(steps / cell).astype(int), 1)
    points = [profile[:1]]
    for k, count in enumerate(counts):
        t = np.linspace(0.0, 1.0, count + 1)[1:, None]
        points.append(profile[k] * (1 - t) + profile[k + 1] * t)
    curve = np.concatenate(points)[1:-1]
    around = max(12, int(np.ceil(2 * np.pi * profile[:, 0].max() / cell)))
    radius = np.broadcast_to(curve[:, :1], (len(curve), around))
    return _wrap_rings(at, axis, curve[:, 1], radius, float(profile[0, 1]), float(profile[-1, 1]))


def _make_tube(start: Float, end: Float, radii: Float, cell: float) -> tuple[Float, Int32]:
    """Returns a round bar from ``start`` to ``end``.

    ``radii`` (R, 2) contains fractions of the length and the radii at these fractions.
    """
    length = float(np.linalg.norm(end - start))
    t = np.linspace(0.0, 1.0, max(2, int(np.ceil(length / cell)) + 1))
    radius = np.broadcast_to(np.interp(t, *radii.T)[:, None], (len(t), 10))
    return _make_rings(start, end, t, radius)


def _make_rings(start: Float, end: Float, t: Float, radius: Float) -> tuple[Float, Int32]:
    """Returns a tube of rings.

    The rings are at the fractions ``t`` (R,) of the length, with ``radius`` (R, K) at K angles.
    """
    way, length = (end - start) / np.linalg.norm(end - start), float(np.linalg.norm(end - start))
    cap = 0.3 * float(radius[0].min())
    return _wrap_rings(start, way, t * length, radius, -cap, length + cap)


def _wrap_rings(
    at: Float, axis: Float, heights: Float, radius: Float, first: float, last: float
) -> tuple[Float, Int32]:
    """Returns rings about an axis, connected to a surface and closed by a point at each end.

    Args:
        heights: (R,) heights of the rings along ``axis`` in metres. ``first`` and ``last`` are the heights of
            the end points.
        radius: (R, K) radii at K angles in metres.
    """
    rings, around = radius.shape
    axis = axis / np.linalg.norm(axis)
    u = np.cross(axis, _PIN_AXIS if abs(axis @ _PIN_AXIS) < 0.9 else np.array([1.0, 0.0, 0.0]))
    u /= np.linalg.norm(u)
    angle = np.arange(around) / around * 2 * np.pi
    spoke = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * np.cross(axis, u)
    body = at + heights[:, None, None] * axis + radius[..., None] * spoke
    vertices = np.concatenate([body.reshape(-1, 3), [at + first * axis, at + last * axis]])
    row, column = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = row * around + column, row * around + (column + 1) % around
    c, d = a + around, b + around
    k = np.arange(around)
    low, high = np.full(around, rings * around), np.full(around, rings * around + 1)
    top = (rings - 1) * around
    faces = [np.stack(f, -1).reshape(-1, 3) for f in ((a, b, c), (b, d, c))]
    faces += [np.stack([low, (k + 1) % around, k], -1), np.stack([high, top + k, top + (k + 1) % around], -1)]
    return vertices, np.concatenate(faces).astype(np.int32)
