"""Encodes a pose in few bytes. Each transform is predicted from its parent in a tree, and only the residuals
are sent.

The transforms of a character form a tree: the minimum spanning tree along the character's edges. The parent's
transform predicts the position of a child's pivot. In a deformation graph, the regulariser pulls the child
towards this position (Sumner et al. 2007, eq. 6). In a rig, this is exactly the child's joint. So the
residuals are small integers, and Rice codes store them in few bits. Sender and receiver build the tree from
their copies of the character. A checksum of four bytes prevents decoding with another character or revision.

The data begins with the tree's CRC-32 (4 bytes, little-endian). The columns of a table (J, 12) of integers
follow, in the tree's order and encoded by :mod:`enliven.wire.bits`: 3 for position, 3 for the rotation
vector, 6 for stretch. The prediction uses decoded parents, so errors do not accumulate along the tree.
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
from enliven.wire.bits import MAX_VALUE, decode_columns, encode_columns
from enliven.wire.fields import MAX_TRANSFORMS
from enliven.wire.quantize import (
    MAX_LINEAR_ENTRY,
    POSITION_STEP,
    ROTATION_STEP,
    STRETCH_STEP,
    apply_stretch_entries,
    compute_stretch,
    nearest_rotation,
    rotate_by_vector,
    rotation_vector,
)

COLUMNS = 12
"""Number of integers per transform: 3 for position, 3 for the rotation vector, 6 for stretch."""


@dataclass(frozen=True)
class EncodedPose:
    """The bytes of a pose, and the number of transforms that were changed because they were not finite or too
    large.
    """

    data: bytes
    clamped: int


class PoseCodec:
    """An encoder and decoder for the poses of one character. Create it once, and use it for every frame.

    Args:
        character: the character with the pivots and edges that define the tree. Sender and receiver must have
            the same character.

    Raises:
        InputError: if the character has more than ``MAX_TRANSFORMS`` transforms.
    """

    def __init__(self, character: Character) -> None:
        count = len(character.pivots)
        if count > MAX_TRANSFORMS:
            raise InputError(
                f"the character has {count} transforms, but at most {MAX_TRANSFORMS} can be sent",
                where=f"character {character.id!r}",
                remedy="Use a coarser deformation graph.",
            )
        self.character = character.id
        self._pivots: Float = np.ascontiguousarray(character.pivots, np.float64)
        self._order, self._parents = find_spanning_tree(self._pivots, character.edges)
        self._shared = character.kind == "graph"
        tree = [character.pivots.astype("<f4"), self._order.astype("<i4"), self._parents.astype("<i4")]
        self._check = zlib.crc32(b"".join(a.tobytes() for a in tree)).to_bytes(4, "little")

    def encode(self, pose: Pose) -> EncodedPose:
        """Returns the bytes of a pose. Equal poses give equal bytes.

        A transform that is not finite is replaced by the prediction. Entries of linear parts are clamped to
        +-64, and positions to a distance of 500 m from their prediction. ``clamped`` counts the changed
        transforms.

        Raises:
            InputError: if the pose has another number of transforms than the character.
        """
        count = len(self._pivots)
        if pose.linear.shape != (count, 3, 3) or pose.positions.shape != (count, 3):
            raise InputError(
                f"the pose has {pose.linear.shape} linear parts and {pose.positions.shape} "
                f"positions, expected {count}",
                where=f"pose of {pose.character!r}",
                remedy="After a change of the deformation graph, publish the character again.",
            )
        linear, positions = pose.linear.astype(np.float64), pose.positions.astype(np.float64)
        table, clamped = _prediction_residuals(
            linear, positions, self._pivots, self._order, self._parents, self._shared
        )
        return EncodedPose(self._check + encode_columns(table).tobytes(), int(clamped))

    def decode(self, data: bytes) -> tuple[Float32, Float32]:
        """Decodes a pose. Returns linear parts (J, 3, 3) and positions (J, 3) in metres.

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
    """Compiles the encoder and the decoder, or loads them from the cache.

    Call it before the first frame, because compilation takes seconds.
    """
    pivots, order, parents = np.zeros((1, 3)), np.zeros(1, np.int64), np.full(1, -1)
    table, _ = _prediction_residuals(np.eye(3)[None], pivots, pivots, order, parents, False)
    encode_columns(table)
    # Decode bytes as in a message. They become a read-only array, for which Numba compiles separate code.
    decode_columns(np.frombuffer(b"\xff" * (COLUMNS // 2), np.uint8), table)
    _restore_pose(table, pivots, order, parents, False)


def find_spanning_tree(pivots: Float, edges: AnyArray) -> tuple[Int, Int]:
    """Returns the minimum spanning tree of pivots (J, 3), metres: the order (J,) in which transforms are
    added to the tree, and the parent (J,) of each transform.

    Edges of the character (E, 2) are preferred to all other pairs, so that two legs do not predict each
    other. Pairs without an edge only connect otherwise separate parts. The first transform is the root, with
    parent -1. The function uses Prim's algorithm. In a tie, the lower index is chosen, so that sender and
    receiver compute the same tree.
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
"""Penalty in square metres that is added to the squared distance of pivots without an edge."""


def _squared_distances(points: Float, point: Float) -> Float:
    """Computes the squared distances (J,) from ``points`` (J, 3) to a point, in square metres. The order of
    the sums is fixed, so that every machine gets the same bits.
    """
    d = points - point
    return np.asarray(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1] + d[:, 2] * d[:, 2])


@njit(cache=True, nogil=True)
def _predict_position(
    i: int, parent: int, pivots: Float, linear: Float, positions: Float, shared: bool, out: Float
) -> None:
    """Predicts the position of transform i from its decoded parent, and writes it to ``out`` (3,).

    If ``shared`` is True (a graph), the mean of the linear parts of child and parent is used, because the
    surface between two nodes is a blend of both. Otherwise the child is rigidly attached to its parent (a
    rig).
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
    rotate_by_vector(before, row[3] * step, row[4] * step, row[5] * step, quaternions[i])
    stretch = room[3]
    for c in range(6):
        stretches[i, c] = row[6 + c] + (stretches[parent, c] if parent >= 0 else 0)
        stretch[c] = stretches[i, c] * STRETCH_STEP
    rotation_matrix(quaternions[i], room[:3, :3])
    apply_stretch_entries(room[:3, :3], stretch, linear[i])


@njit(cache=True, nogil=True)
def _difference_linear(
    a: Float, i: int, parent: int, quaternions: Float, stretches: Int32, rooms: Float, row: Int32
) -> None:
    """Computes the residual of the linear part ``a`` (3, 3) relative to the parent's decoded rotation and
    stretch, and writes it to row[3:].

    The rotation is computed in the parent's frame. There it is small, so the iteration converges fast.
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
    compute_stretch(relative, rotation, stretch)
    for c in range(3):
        row[3 + c] = int(np.floor(turn[c] / ROTATION_STEP + 0.5))
    for c in range(6):
        inherited = stretches[parent, c] if parent >= 0 else 0
        row[6 + c] = int(np.floor(stretch[c] / STRETCH_STEP + 0.5)) - inherited


@njit(cache=True, nogil=True)
def _limit_linear_part(source: Float, a: Float) -> bool:
    """Copies a linear part from ``source`` to ``a``. Scales it down if an entry exceeds ``MAX_LINEAR_ENTRY``.

    Returns True if it was scaled.
    """
    largest = 0.0
    for r in range(3):
        for c in range(3):
            a[r, c] = source[r, c]
            largest = max(largest, abs(a[r, c]))
    if largest > MAX_LINEAR_ENTRY:
        a *= MAX_LINEAR_ENTRY / largest
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
    """Allocates the arrays for decoding: quaternions (the last one is the identity), stretches, and work
    space."""
    quaternions = np.empty((count + 1, 4))
    quaternions[count, 0], quaternions[count, 1:] = 1.0, 0.0
    return quaternions, np.empty((count, 6), np.int32), np.empty((5, 4, 6))


@njit(cache=True, nogil=True)
def _prediction_residuals(
    linear: Float, positions: Float, pivots: Float, order: Int, parents: Int, shared: bool
) -> tuple[Int32, int]:
    """Computes the residuals (J, 12) of the predictions, in the tree's order. Also returns the number of
    clamped transforms."""
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
                changed = changed or abs(off) > MAX_VALUE
                row[c] = int(np.floor(min(max(off, -float(MAX_VALUE)), float(MAX_VALUE)) + 0.5))
            seen_positions[i, c] = expected[c] + row[c] * POSITION_STEP
        clamped += changed
    return table, clamped


@njit(cache=True, nogil=True)
def _restore_pose(
    table: Int32, pivots: Float, order: Int, parents: Int, shared: bool
) -> tuple[Float32, Float32]:
    """Computes linear parts (J, 3, 3) and positions (J, 3) from the residuals ``table`` (J, 12)."""
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
