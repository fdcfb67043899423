"""A wooden armchair that a standing person fits into."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Int, UInt8
from enliven.kernels import njit
from enliven.meshes import Mesh
from sample_meshes.isosurface import surface_of

_OAK_COLOUR = (181, 126, 74)
"""sRGB of most of the wood, 0..255."""
_STAINED_COLOUR = (139, 88, 47)
"""sRGB of the stained wood, 0..255: armrests, stretchers and the crest."""
_FABRIC_COLOUR = (62, 108, 122)
"""sRGB of the cushions, 0..255. A board of this colour gets no wood grain."""
_FILLET_WIDTH = 0.010
"""Width in metres of the fillet between two wooden parts."""
_MAX_DISTANCE = 0.05
"""Maximum distance in metres that is computed. Larger distances are not needed."""


@dataclass(frozen=True)
class _Board:
    """A part with a rounded rectangular section that is swept along a curve.

    Attributes:
        path: (P, 3) the curve in metres that the middle of the section follows.
        half: (P, 2) half the section's width along ``across`` and half its thickness, in metres.
        across: (3,) unit direction of the width.
        rounding: radius of the rounded edges in metres.
        colour: sRGB.
    """

    path: Float
    half: Float
    across: tuple[float, float, float]
    rounding: float
    colour: tuple[int, int, int]


def make_chair(cell: float = 0.0135) -> Mesh:
    """Creates an armchair 1.75 m tall that a standing person can possess. It faces +Z and stands on y = 0.

    The origin is under the back. For a person that stands there and faces +Z, the legs are in the chair's
    back legs, and the hips in the seat's rear rail at 0.85 m. The spine and the head are in the raked back.
    The forearms, held forward at 1.1 m, are in the armrests. The front ends of the armrests are free so that
    they move like arms. The side stretchers make the front legs walk with the back legs. The surface is
    closed and connected, so that no part can separate. It has vertex colours.

    Args:
        cell: approximate length of an edge in metres.
    """
    boards = _make_chair_boards()
    pieces, starts = _pieces(boards)
    boxes = _boxes(boards)
    wood = np.array([board.colour != _FABRIC_COLOUR for board in boards])

    def field(points: Float) -> Float:
        return np.asarray(_distance(points, pieces, starts, boxes, wood)[0])

    low, high = np.array([-0.42, -0.03, -0.22]), np.array([0.42, 1.80, 0.66])
    vertices, faces = surface_of(field, low, high, cell)
    nearest = np.asarray(_distance(vertices, pieces, starts, boxes, wood)[1])
    vertices[:, 1] -= vertices[:, 1].min()
    return Mesh(vertices, faces, "chair", _compute_vertex_colours(vertices, nearest, boards))


def _make_curve(*points: tuple[float, float, float], count: int = 10) -> Float:
    """Returns (count, 3) points of a Bezier curve with the given control points."""
    control = np.array(points, np.float64)
    t = np.linspace(0, 1, count)[:, None, None]
    while len(control) > 1 or control.ndim < 3:
        if control.ndim < 3:
            control = np.broadcast_to(control, (count, *control.shape))
        if control.shape[1] == 1:
            break
        control = control[:, :-1] * (1 - t) + control[:, 1:] * t
    return np.ascontiguousarray(control[:, 0])


def _make_taper(path: Float, first: tuple[float, float], last: tuple[float, float]) -> Float:
    """Returns (P, 2) half sizes, interpolated linearly from ``first`` to ``last`` along ``path``."""
    t = np.linspace(0, 1, len(path))[:, None]
    return np.array(first) * (1 - t) + np.array(last) * t


def _make_chair_boards() -> list[_Board]:
    """Returns all parts of the chair. Seen from the seat, x points to the left, y up and z forward."""
    boards = [*_make_seat(), *_make_back()]
    for side in (-1.0, 1.0):
        boards += [*_make_legs(side), *_make_arm(side)]
    return boards


def _make_legs(side: float) -> list[_Board]:
    """Returns a back leg, a front leg, and the stretcher between them.

    The back leg continues upward as the post of the back.
    """
    x = side * 0.222
    lower = _make_curve((x, 0.022, -0.045), (x, 0.45, 0.0), (side * 0.215, 0.85, 0.0))
    post = _make_curve((side * 0.215, 0.85, 0.0), (side * 0.212, 1.3, -0.01), (side * 0.205, 1.69, -0.085))
    front = _make_curve((side * 0.235, 0.022, 0.515), (side * 0.235, 0.45, 0.50), (side * 0.228, 0.80, 0.485))
    stretcher = _make_curve((x, 0.30, -0.015), (side * 0.228, 0.285, 0.25), (side * 0.235, 0.30, 0.505))
    right = (1.0, 0.0, 0.0)
    return [
        _Board(lower, _make_taper(lower, (0.026, 0.028), (0.037, 0.040)), right, 0.014, _OAK_COLOUR),
        _Board(post, _make_taper(post, (0.037, 0.040), (0.030, 0.028)), right, 0.014, _OAK_COLOUR),
        _Board(front, _make_taper(front, (0.026, 0.026), (0.038, 0.038)), right, 0.014, _OAK_COLOUR),
        _Board(
            stretcher, _make_taper(stretcher, (0.018, 0.026), (0.018, 0.026)), right, 0.011, _STAINED_COLOUR
        ),
    ]


def _make_arm(side: float) -> list[_Board]:
    """Returns an armrest.

    It begins at the back's post, curves outward, and ends freely over the front leg.
    """
    rest = _make_curve(
        (side * 0.214, 1.085, -0.01),
        (side * 0.225, 1.115, 0.12),
        (side * 0.285, 1.115, 0.28),
        (side * 0.272, 1.085, 0.45),
        count=14,
    )
    half = _make_taper(rest, (0.032, 0.026), (0.046, 0.024))
    brace = _make_curve((side * 0.215, 0.965, 0.0), (side * 0.218, 0.99, 0.10), (side * 0.245, 1.09, 0.17))
    right = (1.0, 0.0, 0.0)
    return [
        _Board(rest, half, right, 0.018, _STAINED_COLOUR),
        _Board(brace, _make_taper(brace, (0.020, 0.022), (0.020, 0.020)), right, 0.013, _OAK_COLOUR),
    ]


def _make_seat() -> list[_Board]:
    """Returns the rails around the seat, and the cushion on them."""
    right, forward = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    boards = []
    for z, thick in ((0.0, 0.026), (0.485, 0.026)):
        rail = _make_curve((-0.22, 0.775, z), (0.0, 0.775, z), (0.22, 0.775, z), count=4)
        boards.append(
            _Board(rail, _make_taper(rail, (thick, 0.042), (thick, 0.042)), forward, 0.012, _OAK_COLOUR)
        )
    for side in (-1.0, 1.0):
        rail = _make_curve(
            (side * 0.218, 0.775, 0.0), (side * 0.226, 0.775, 0.25), (side * 0.228, 0.775, 0.485)
        )
        boards.append(
            _Board(rail, _make_taper(rail, (0.026, 0.042), (0.026, 0.042)), right, 0.012, _OAK_COLOUR)
        )
    cushion = _make_curve((0.0, 0.842, 0.062), (0.0, 0.858, 0.25), (0.0, 0.842, 0.505), count=6)
    boards.append(
        _Board(cushion, _make_taper(cushion, (0.222, 0.046), (0.247, 0.044)), right, 0.040, _FABRIC_COLOUR)
    )
    return boards


def _make_back() -> list[_Board]:
    """Returns the crest rail, the lower rail, and three slats between them.

    The middle slat contains the performer's spine.
    """
    forward, right = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
    crest = _make_curve((-0.225, 1.655, -0.078), (0.0, 1.755, -0.125), (0.225, 1.655, -0.078), count=16)
    bulge = np.sin(np.linspace(0, np.pi, 16))[:, None]
    half = _make_taper(crest, (0.024, 0.042), (0.024, 0.042)) + bulge * [0, 0.022]
    boards = [_Board(crest, half, forward, 0.016, _STAINED_COLOUR)]
    lower = _make_curve((-0.215, 0.96, 0.0), (0.0, 0.96, -0.022), (0.215, 0.96, 0.0), count=8)
    boards.append(
        _Board(lower, _make_taper(lower, (0.020, 0.032), (0.020, 0.032)), forward, 0.012, _OAK_COLOUR)
    )
    for x, half in ((-0.118, 0.027), (0.0, 0.050), (0.118, 0.027)):
        bow = -0.02 * (1 - (x / 0.215) ** 2)
        slat = _make_curve((x, 0.95, bow / 2), (x * 1.02, 1.3, bow - 0.012), (x * 1.03, 1.67, -0.085 + bow))
        boards.append(
            _Board(slat, _make_taper(slat, (half, 0.017), (half, 0.017)), right, 0.010, _OAK_COLOUR)
        )
    return boards


class _Pieces(NamedTuple):
    """The S straight pieces of all boards, in the form that the distance function needs.

    Attributes:
        start: (S, 3) metres.
        along: (S, 3) vector from start to end in metres.
        square: (S,) squared length in square metres.
        axes: (S, 3, 3) unit axes: the width and the thickness of the section, and the direction of the piece.
        half: (S, 2, 2) half sizes of the section at the start and at the end, in metres.
        reach: (S,) maximum distance in metres of the piece's surface from its middle line.
        rounding: (S,) radius of the rounded edges in metres.
    """

    start: Float
    along: Float
    square: Float
    axes: Float
    half: Float
    reach: Float
    rounding: Float


def _pieces(boards: list[_Board]) -> tuple[_Pieces, Int]:
    """Returns the pieces of all boards, and (B + 1,) the index at which each board's pieces start."""
    counts = [len(board.path) - 1 for board in boards]
    start = np.concatenate([board.path[:-1] for board in boards])
    along = np.concatenate([board.path[1:] for board in boards]) - start
    length = np.sqrt((along * along).sum(1, keepdims=True))
    way = along / length
    # Make ``across`` perpendicular to the piece's direction, and compute the third axis.
    across = np.repeat([board.across for board in boards], counts, axis=0)
    across = across - (across * way).sum(1, keepdims=True) * way
    across /= np.sqrt((across * across).sum(1, keepdims=True))
    half = np.concatenate([np.stack([board.half[:-1], board.half[1:]], 1) for board in boards])
    rounding = np.repeat([board.rounding for board in boards], counts)
    axes = np.stack([across, np.cross(way, across), way], 1)
    reach = half.max(1).sum(1)
    pieces = _Pieces(start, along, (length * length)[:, 0], axes, half, reach, rounding)
    return pieces, np.concatenate([[0], np.cumsum(counts)])


def _boxes(boards: list[_Board]) -> Float:
    """Returns (B, 6) the lowest and the highest corner of a box around each board."""
    reach = [np.hypot(*board.half.max(0)) for board in boards]
    pairs = zip(boards, reach, strict=True)
    return np.array([[*(b.path.min(0) - r), *(b.path.max(0) + r)] for b, r in pairs])


@njit(cache=True, nogil=True)
def _distance(points, pieces, starts, boxes, wood):
    """Returns (N,) the signed distance of ``points`` (N, 3) to all boards in metres, and (N,) the nearest
    board.

    The distance is at most _MAX_DISTANCE.

    Wooden boards are joined with a fillet (I. Quilez's polynomial smooth minimum). The cushion is joined
    without a fillet.
    """
    distance = np.empty(points.shape[0])
    nearest = np.zeros(points.shape[0], np.int64)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        joined, soft, closest = _MAX_DISTANCE, _MAX_DISTANCE, _MAX_DISTANCE
        for b in range(boxes.shape[0]):
            # A board farther away than this does not change the result.
            bound = min(_MAX_DISTANCE, max(joined + _FILLET_WIDTH, closest)) if wood[b] else soft
            if x < boxes[b, 0] - bound or x > boxes[b, 3] + bound:
                continue
            if y < boxes[b, 1] - bound or y > boxes[b, 4] + bound:
                continue
            if z < boxes[b, 2] - bound or z > boxes[b, 5] + bound:
                continue
            d = bound
            for s in range(starts[b], starts[b + 1]):
                d = _nearer(x, y, z, pieces, s, d)
            if d >= bound:
                continue
            if d < closest:
                closest = d
                nearest[i] = b
            if not wood[b]:
                soft = d
                continue
            h = max(_FILLET_WIDTH - abs(joined - d), 0.0) / _FILLET_WIDTH
            joined = min(joined, d) - h * h * _FILLET_WIDTH / 4
        distance[i] = min(joined, soft)
    return distance, nearest


@njit(cache=True, nogil=True)
def _nearer(x, y, z, pieces, s, bound):
    """Returns the signed distance of a point to one straight piece, or ``bound`` if it is larger.

    The piece has a rounded rectangular section.
    """
    ax, ay, az = pieces.along[s, 0], pieces.along[s, 1], pieces.along[s, 2]
    dx, dy, dz = x - pieces.start[s, 0], y - pieces.start[s, 1], z - pieces.start[s, 2]
    t = min(1.0, max(0.0, (dx * ax + dy * ay + dz * az) / pieces.square[s]))
    dx, dy, dz = dx - t * ax, dy - t * ay, dz - t * az
    far = max(bound + pieces.reach[s], 0.0)
    if dx * dx + dy * dy + dz * dz > far * far:
        return bound
    axes, half, r = pieces.axes[s], pieces.half[s], pieces.rounding[s]
    qu = (
        abs(dx * axes[0, 0] + dy * axes[0, 1] + dz * axes[0, 2]) - ((1 - t) * half[0, 0] + t * half[1, 0]) + r
    )
    qv = (
        abs(dx * axes[1, 0] + dy * axes[1, 1] + dz * axes[1, 2]) - ((1 - t) * half[0, 1] + t * half[1, 1]) + r
    )
    qw = abs(dx * axes[2, 0] + dy * axes[2, 1] + dz * axes[2, 2])
    outside = np.sqrt(max(qu, 0.0) ** 2 + max(qv, 0.0) ** 2 + qw * qw)
    if qw > 0.0:
        return min(bound, outside - r)
    return min(bound, outside + min(max(qu, qv), 0.0) - r)


def _compute_vertex_colours(vertices: Float, nearest: Int, boards: list[_Board]) -> UInt8:
    """Returns (V, 3) the colours of the boards, with a faint grain along the wood."""
    colours = np.array([board.colour for board in boards], np.float64)[nearest]
    wood = np.array([board.colour != _FABRIC_COLOUR for board in boards])[nearest]
    x, y, z = vertices.T
    grain = 0.05 * np.sin(41 * x + 9 * np.sin(3 * y) + nearest) + 0.04 * np.sin(57 * z + 7 * np.sin(4 * y))
    shaded = colours * (1 + np.where(wood, grain, 0.0))[:, None]
    return np.asarray(np.clip(shaded, 0, 255), np.uint8)
