"""Encodes a pose in few bytes: every transform is predicted from its neighbour, and only the residuals are
sent.

The transforms of a character form a tree: the minimum spanning tree along the character's edges. A child's
pivot is predicted by the parent's transform. This is the position towards which the regulariser of embedded
deformation pulls the child (Sumner et al. 2007, eq. 6) and, for a bone, exactly the child's joint. So the
residuals are small integers, and Rice codes store them in few bits. Sender and receiver build the tree from
their copies of the character. Because of four check bytes, a pose of any other character or revision is
refused.

The layout is the tree's CRC-32 (4 bytes, little-endian), then the columns of :mod:`enliven.wire.bits` for a
(J, 12) table of integers in the tree's order: 3 position, 3 rotation vector, 6 stretch. The prediction uses
the decoded parents, so errors never add up along the tree.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Float, Float32, Int, Int32
from enliven.document import Character, Pose
from enliven.errors import InputError
from enliven.kernels import njit
from enliven.rotation import rotation_matrix
from enliven.wire.bits import LIMIT, decode_columns, encode_columns
from enliven.wire.fields import MAX_TRANSFORMS
from enliven.wire.quantize import (
    LARGEST_LINEAR,
    POSITION_STEP,
    ROTATION_STEP,
    STRETCH_STEP,
    nearest_rotation,
    rotation_vector,
    stretch_of,
    stretched,
    turned_by,
)

COLUMNS = 12
"""Number of integers per transform: 3 of position, 3 of the rotation vector, 6 of the stretch."""


@dataclass(frozen=True)
class EncodedPose:
    """The bytes of a pose, and the number of transforms that were changed because they were not finite or too
    large.
    """

    data: bytes
    clamped: int


class PoseCodec:
    """Encodes and decodes the poses of one character. Create it once, and use it for every frame.

    Args:
        character: its pivots and edges define the tree. Sender and receiver must have the same character.

    Raises:
        InputError: for more than ``MAX_TRANSFORMS`` transforms.
    """

    def __init__(self, character: Character) -> None:
        count = len(character.pivots)
        if count > MAX_TRANSFORMS:
            raise InputError(
                f"it has {count} transforms, at most {MAX_TRANSFORMS} go on the wire",
                where=f"character {character.id!r}",
                remedy="Use a coarser deformation graph.",
            )
        self.character = character.id
        self._pivots: Float = np.ascontiguousarray(character.pivots, np.float64)
        self._order, self._parents = spanning_tree(self._pivots, character.edges)
        self._shared = character.kind == "graph"
        tree = [character.pivots.astype("<f4"), self._order.astype("<i4"), self._parents.astype("<i4")]
        self._check = zlib.crc32(b"".join(a.tobytes() for a in tree)).to_bytes(4, "little")

    def encode(self, pose: Pose) -> EncodedPose:
        """Returns the bytes of a pose. Equal poses give equal bytes.

        A transform that is not finite is replaced by the parent's prediction. An entry beyond +-64, or a
        position more than 500 m from its prediction, is clamped. Both are counted in ``clamped``.

        Raises:
            InputError: if the pose has another number of transforms than the character.
        """
        count = len(self._pivots)
        if pose.linear.shape != (count, 3, 3) or pose.positions.shape != (count, 3):
            raise InputError(
                f"it has {pose.linear.shape} linear parts and {pose.positions.shape} positions, not {count}",
                where=f"pose of {pose.character!r}",
                remedy="Publish the character again after a change of its graph.",
            )
        linear, positions = pose.linear.astype(np.float64), pose.positions.astype(np.float64)
        table, clamped = _prediction_residuals(
            linear, positions, self._pivots, self._order, self._parents, self._shared
        )
        return EncodedPose(self._check + encode_columns(table).tobytes(), int(clamped))

    def decode(self, data: bytes) -> tuple[Float32, Float32]:
        """Returns (J, 3, 3) linear parts and (J, 3) positions in metres.

        Raises:
            ValueError: for bytes that are not a pose of this character.
        """
        if data[:4] != self._check:
            raise ValueError("the pose belongs to another revision of the character")
        table = np.empty((len(self._pivots), COLUMNS), np.int32)
        if not decode_columns(np.frombuffer(data, np.uint8, offset=4), table):
            raise ValueError("the packed transforms are truncated or damaged")
        linear, positions = _restore_pose(table, self._pivots, self._order, self._parents, self._shared)
        return linear, positions


def warm_up() -> None:
    """Compiles the decoder, or loads it from the cache.

    Call it before the first frame, because compilation takes seconds.
    """
    table = np.empty((1, COLUMNS), np.int32)
    # Use bytes as in a message: they become a read-only array, which is a separate type for Numba.
    decode_columns(np.frombuffer(b"\xff" * (COLUMNS // 2), np.uint8), table)
    _restore_pose(table, np.zeros((1, 3)), np.zeros(1, np.int64), np.full(1, -1), False)


def spanning_tree(pivots: Float, edges: AnyArray) -> tuple[Int, Int]:
    """Returns the minimum spanning tree of (J, 3) pivots: (J,) joining order and (J,) parents by index.

    Edges of the character, (E, 2), are preferred to any other pair, so that two legs do not predict each
    other. Pairs without an edge only join otherwise separate parts. The first transform is the root, with
    parent -1. Prim's algorithm is used. Ties are resolved by the lower index, so that both ends find the same
    tree.
    """
    count = len(pivots)
    neighbours: list[list[int]] = [[] for _ in range(count)]
    for a, b in np.asarray(edges, np.int64).reshape(-1, 2):
        neighbours[a].append(int(b))
        neighbours[b].append(int(a))
    cost, parents = np.full(count, np.inf), np.full(count, -1)
    joined, order = np.zeros(count, bool), np.empty(count, np.int64)
    node = 0
    for step in range(count):
        order[step], joined[node] = node, True
        distance = _squared_distances(pivots, pivots[node])
        penalized = distance + _UNLINKED_PENALTY_M2
        penalized[neighbours[node]] = distance[neighbours[node]]
        nearer = ~joined & (penalized < cost)
        cost[nearer], parents[nearer] = penalized[nearer], node
        node = int(np.argmin(np.where(joined, np.inf, cost)))
    return order, parents


_UNLINKED_PENALTY_M2 = 1e9
"""Penalty in square metres for pairs of pivots without an edge."""


def _squared_distances(points: Float, point: Float) -> Float:
    """Returns (J,) squared distances in square metres, summed in a fixed order, so that every machine gets
    the same bits.
    """
    d = points - point
    return np.asarray(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1] + d[:, 2] * d[:, 2])


@njit(cache=True, nogil=True)
def _predict_position(
    i: int, parent: int, pivots: Float, linear: Float, positions: Float, shared: bool, out: Float
) -> None:
    """Writes to ``out`` (3,) the position of transform i that its decoded parent predicts.

    ``shared``: the mean of both ends' linear parts is used, because a graph's nodes are blended half-way
    between them. A bone's child is rigidly attached to its parent.
    """
    for a in range(3):
        out[a] = pivots[i, a] if parent < 0 else positions[parent, a]
        if parent >= 0:
            for b in range(3):
                entry = linear[parent, a, b]
                if shared:
                    entry = 0.5 * (entry + linear[i, a, b])
                out[a] += entry * (pivots[i, b] - pivots[parent, b])


@njit(cache=True, nogil=True)
def _decode_linear(
    i: int, parent: int, row: Int32, quaternions: Float, stretches: Int32, room: Float, linear: Float
) -> None:
    """Decodes transform i: fills its quaternion, stretch and linear part from its row and its parent's
    values.
    """
    before = quaternions[parent] if parent >= 0 else quaternions[len(linear)]
    step = ROTATION_STEP
    turned_by(before, row[3] * step, row[4] * step, row[5] * step, quaternions[i])
    stretch = room[3]
    for c in range(6):
        stretches[i, c] = row[6 + c] + (stretches[parent, c] if parent >= 0 else 0)
        stretch[c] = stretches[i, c] * STRETCH_STEP
    rotation_matrix(quaternions[i], room[:3, :3])
    stretched(room[:3, :3], stretch, linear[i])


@njit(cache=True, nogil=True)
def _difference_linear(
    a: Float, i: int, parent: int, quaternions: Float, stretches: Int32, rooms: Float, row: Int32
) -> None:
    """Writes to row[3:] the residual of the (3, 3) linear part ``a`` relative to the parent's decoded
    rotation and stretch.

    The rotation is computed in the parent's frame, where it is small and converges fast.
    """
    q, turn, stretch = rooms[2, 0, :4], rooms[2, 1, :3], rooms[2, 2]
    rotation, relative = rooms[3, :3, :3], rooms[4, :3, :3]
    rotation_matrix(quaternions[parent] if parent >= 0 else quaternions[len(quaternions) - 1], rotation)
    for r in range(3):
        for c in range(3):
            relative[r, c] = rotation[0, r] * a[0, c] + rotation[1, r] * a[1, c] + rotation[2, r] * a[2, c]
    nearest_rotation(relative, rooms[:2, :, :4], q)
    rotation_vector(q, turn)
    rotation_matrix(q, rotation)
    stretch_of(relative, rotation, stretch)
    for c in range(3):
        row[3 + c] = int(np.floor(turn[c] / ROTATION_STEP + 0.5))
    for c in range(6):
        inherited = stretches[parent, c] if parent >= 0 else 0
        row[6 + c] = int(np.floor(stretch[c] / STRETCH_STEP + 0.5)) - inherited


@njit(cache=True, nogil=True)
def _limit_linear_part(source: Float, a: Float) -> bool:
    """Copies a linear part. Scales it down if an entry exceeds ``LARGEST_LINEAR``.

    Returns True if it was scaled.
    """
    largest = 0.0
    for r in range(3):
        for c in range(3):
            a[r, c] = source[r, c]
            largest = max(largest, abs(a[r, c]))
    if largest > LARGEST_LINEAR:
        a *= LARGEST_LINEAR / largest
        return True
    return False


@njit(cache=True, nogil=True)
def _is_finite(linear: Float, position: Float) -> bool:
    """Returns True if a transform has no NaN and no infinity."""
    for r in range(3):
        if not np.isfinite(position[r]):
            return False
        for c in range(3):
            if not np.isfinite(linear[r, c]):
                return False
    return True


@njit(cache=True, nogil=True)
def _decoding_arrays(count: int) -> tuple[Float, Int32, Float]:
    """Returns arrays for decoded quaternions (the identity at the end), decoded stretches, and work space."""
    quaternions = np.empty((count + 1, 4))
    quaternions[count, 0], quaternions[count, 1:] = 1.0, 0.0
    return quaternions, np.empty((count, 6), np.int32), np.empty((5, 4, 6))


@njit(cache=True, nogil=True)
def _prediction_residuals(
    linear: Float, positions: Float, pivots: Float, order: Int, parents: Int, shared: bool
) -> tuple[Int32, int]:
    """Returns (J, 12) residuals of the predictions, in tree order, and the number of clamped transforms."""
    count, clamped = len(order), 0
    table = np.zeros((count, COLUMNS), np.int32)
    quaternions, stretches, rooms = _decoding_arrays(count)
    seen_linear, seen_positions = np.empty((count, 3, 3)), np.empty((count, 3))
    a, expected = np.empty((3, 3)), np.empty(3)
    for k in range(count):
        i, row = order[k], table[k]
        parent = parents[i]
        finite = _is_finite(linear[i], positions[i])
        changed = not finite
        if finite:
            changed = _limit_linear_part(linear[i], a)
            _difference_linear(a, i, parent, quaternions, stretches, rooms, row)
        _decode_linear(i, parent, row, quaternions, stretches, rooms[0], seen_linear)
        _predict_position(i, parent, pivots, seen_linear, seen_positions, shared, expected)
        for c in range(3):
            if finite:
                off = (positions[i, c] - expected[c]) / POSITION_STEP
                changed = changed or abs(off) > LIMIT
                row[c] = int(np.floor(min(max(off, -float(LIMIT)), float(LIMIT)) + 0.5))
            seen_positions[i, c] = expected[c] + row[c] * POSITION_STEP
        clamped += changed
    return table, clamped


@njit(cache=True, nogil=True)
def _restore_pose(
    table: Int32, pivots: Float, order: Int, parents: Int, shared: bool
) -> tuple[Float32, Float32]:
    """Returns (J, 3, 3) linear parts and (J, 3) positions from the residuals."""
    count = len(order)
    quaternions, stretches, rooms = _decoding_arrays(count)
    linear, positions, expected = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty(3)
    for k in range(count):
        i = order[k]
        parent = parents[i]
        _decode_linear(i, parent, table[k], quaternions, stretches, rooms[0], linear)
        _predict_position(i, parent, pivots, linear, positions, shared, expected)
        for c in range(3):
            positions[i, c] = expected[c] + table[k, c] * POSITION_STEP
    return linear.astype(np.float32), positions.astype(np.float32)
