"""Overdub of a possessed mesh: adds a live or recorded performance to a mesh that already has motion.

The new motion becomes a layer in the rest space of the mesh. The nodes and the placement of the mesh on the
stage differ from the nodes and the placement of the project's mesh. The rigid motion that most nodes on the
stage share is removed, so that parts that no performer moved are static. The remaining motion is transferred
to the nodes of the project's mesh.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from enliven.arrays import Float, Int
from enliven.document import (
    Character,
    GraphCharacter,
    GraphLayer,
    Pose,
    PoseStream,
    Project,
    unused,
)
from enliven.kernels import njit
from enliven.modeling.possessed.even_steps import resample_evenly
from enliven.modeling.possessed.pose import compose_with_base
from enliven.overdub.performance import PerformedCharacter
from enliven.overdub.punch_in import PunchIn
from enliven.rotation import nearest_quaternion, rotation_matrix
from enliven.similarity import Similarity, fit_similarity

_SAME_NODE_M = 2e-3
"""Maximum distance, metres, between two equal nodes. It allows for the quantization of transmitted poses."""
_REWEIGHTING_ITERATIONS = 12
"""Number of iterations of reweighted least squares. For a mesh of a chair's size, the last iterations change
the result by less than a millimetre."""
_MIN_WEIGHTED_DISTANCE_M = 2e-3
"""Minimum residual, metres, in the weight of a node. It is the quantization step of transmitted poses, and
limits the weight of nodes that fit exactly."""


def has_motion(project: Project, shape: GraphCharacter) -> bool:
    """Returns True if a possessed mesh has earlier motion that can be overdubbed."""
    return any(project.streams[layer.take].duration > 0.0 for layer in (*shape.parts, *shape.over))


class OverdubTransfer:
    """Transfers poses of a mesh on a stage to the nodes of a project's shape, in the rest space of the shape.

    Args:
        shape: the shape in the project.
        character: the mesh on the stage.
    """

    def __init__(self, shape: GraphCharacter, character: Character) -> None:
        pivots = np.asarray(character.pivots, np.float64)
        surface = np.asarray(character.vertices, np.float64)
        vertices = np.asarray(shape.mesh.vertices)
        is_same_mesh = surface.shape == vertices.shape
        self._same = fit_similarity(surface, vertices) if is_same_mesh else Similarity()
        self._rest = shape.positions
        self._at = self._same.transform_back(shape.positions)
        nearest = scipy.spatial.cKDTree(surface).query(self._at)[1]
        self._nodes: Int = character.skin.indices[nearest].astype(np.int64)
        self._weights: Float = character.skin.weights[nearest].astype(np.float64)
        distances, node = scipy.spatial.cKDTree(pivots).query(self._at)
        # If both meshes have a node at the same position, use the transform of the node instead of the motion
        # of the surface around it.
        is_shared = distances < _SAME_NODE_M
        self._nodes[is_shared], self._weights[is_shared] = (
            node[is_shared, None],
            np.array([1.0, 0.0, 0.0, 0.0]),
        )
        self._arms: Float = self._at[:, None] - pivots[self._nodes]
        self._pivots, self._scale = pivots, 0.0

    def __call__(self, linear: Float, positions: Float) -> tuple[Float, Float]:
        """Transfers poses. Returns linear maps (F, K, 3, 3) and displacements (F, K, 3) of the project's
        nodes, metres of the rest space.

        Args:
            linear, positions: linear maps (F, N, 3, 3) and positions (F, N, 3), metres, of the nodes on the
                stage in the world.
        """
        if not self._scale:
            # Use the scale of the placement. A performer bends a mesh but does not scale it, so the scale is
            # constant.
            self._scale = float(np.cbrt(np.median(np.abs(np.linalg.det(linear[0])))))
        turns, places = find_shared_motion(positions / self._scale, self._pivots)
        node_weights = self._weights / self._scale
        surface_maps = linear[:, self._nodes]
        maps = np.einsum("kw,fkwij->fkij", node_weights, surface_maps)
        displacements = np.einsum("kwj,fkwij->fki", node_weights[..., None] * self._arms, surface_maps)
        displacements += np.einsum("kw,fkwi->fki", node_weights, positions[:, self._nodes])
        offsets = (displacements - places[:, None]) @ turns - self._at
        rest_rotation = self._same.turn
        unrotation = rest_rotation @ np.swapaxes(turns, 1, 2)
        return unrotation[:, None] @ maps @ rest_rotation.T, self._same.size * offsets @ rest_rotation.T


class LiveOverdub:
    """A player of a project's possessed mesh that adds a live pose to its motion, as a preview of the
    overdub."""

    def __init__(self, project: Project, shape_id: str, character: Character) -> None:
        self._within = OverdubTransfer(project.graph(shape_id), character)
        self._last: tuple[Pose, Float, Float] | None = None

    def pose(self, live: Pose, base: Pose) -> Pose:
        """Returns the pose of the project's mesh, metres in the world.

        Args:
            live: the pose of the mesh on the stage. Its conversion is cached, because the display rate is
                higher than the pose rate.
            base: the pose of the project's mesh without the live pose.
        """
        if self._last is None or self._last[0] is not live:
            arrays = (np.asarray(values, np.float64)[None] for values in (live.linear, live.positions))
            maps, offsets = self._within(*arrays)
            self._last = live, maps[0], offsets[0]
        plays = base.linear.astype(np.float64), base.positions.astype(np.float64)
        linear, positions = compose_with_base(plays, *self._last[1:])
        return Pose(base.character, live.time_ns, linear.astype(np.float32), positions.astype(np.float32))


def add_node_motion(project: Project, shape: GraphCharacter, motion: PerformedCharacter) -> Project | None:
    """Adds the new motion of a possessed mesh to its earlier motion. Returns None if no earlier motion
    remains.
    """
    if not has_motion(project, shape):
        return None
    span = motion.span(project)
    # Muted alternatives may be enabled again, so they must be kept.
    has_muted = any(layer.muted for layer in shape.playing)
    if motion.replaces and not has_muted and not span.moves_outside(project, shape.playing):
        return None
    return _add_overdub_layer(project, shape, motion, span if motion.replaces else None)


def _add_overdub_layer(
    project: Project, shape: GraphCharacter, motion: PerformedCharacter, punch: PunchIn | None
) -> Project:
    """Adds a performance to a possessed mesh as an additional layer. Returns the edited project.

    Args:
        punch: the time span in which all other motion of the mesh is muted. None mutes nothing.

    Raises:
        InputError: if the poses are inconsistent.
    """
    holds = motion.holds(project)
    linear, positions, grid = resample_evenly(motion.character, motion.poses, motion.begin)
    maps, offsets = OverdubTransfer(shape, motion.character)(linear, positions)
    stream = PoseStream(
        unused(f"{shape.id} over", project.streams), maps, shape.positions + offsets, float(grid[1] - grid[0])
    )
    possession = None if holds is None else holds.possession(motion.key, motion.character, motion.poses)
    if holds is not None and possession is not None:
        project = project.with_bodies(holds.take)
    nodes = np.arange(len(shape.positions))
    span = punch or PunchIn.from_interval(project, float(grid[0]), float(grid[-1]))
    layer = GraphLayer(
        stream.id,
        nodes,
        nodes,
        shape.positions,
        possession=possession,
        offset=float(grid[0]),
        **span.playback_settings,
    )
    if punch is not None:
        parts = (punch(project, part) or replace(part, muted=True) for part in shape.parts)
        old_layers = (punch(project, old_layer) for old_layer in shape.over)
        shape = shape.with_changes(
            parts=tuple(parts), over=tuple(old_layer for old_layer in old_layers if old_layer is not None)
        )
    shape = shape.with_changes(over=(*shape.over, layer))
    return project.with_streams(stream).with_characters(shape)


def find_shared_motion(positions: Float, rest: Float) -> tuple[Float, Float]:
    """Returns the rotations (F, 3, 3) and translations (F, 3) that move ``rest`` (N, 3) to most of the
    ``positions`` (F, N, 3).

    It is the rigid motion with the smallest sum of distances, computed by iteratively reweighted least
    squares (Weiszfeld's algorithm). So a minority of nodes with other motion has hardly any effect.
    """
    turns, moves = np.zeros((len(positions), 3, 3)), np.zeros((len(positions), 3))
    _fit_shared_motion(
        np.ascontiguousarray(positions, np.float64), np.asarray(rest, np.float64), turns, moves
    )
    return turns, moves


@njit(cache=True, nogil=True)
def _fit_shared_motion(positions, rest, turns, moves):
    """Computes for :func:`find_shared_motion` the rotations ``turns`` (F, 3, 3) and translations ``moves``
    (F, 3)."""
    weights, spread = np.empty(rest.shape[0]), np.empty((3, 3))
    middle, centre = np.empty(3), np.empty(3)
    for f in range(positions.shape[0]):
        weights[:] = 1.0
        for _ in range(_REWEIGHTING_ITERATIONS):
            _weighted_moments(positions[f], rest, weights, middle, centre, spread)
            rotation_matrix(nearest_quaternion(spread), turns[f])
            for i in range(3):
                moves[f, i] = middle[i]
                for j in range(3):
                    moves[f, i] -= turns[f, i, j] * centre[j]
            _update_weights(positions[f], rest, turns[f], moves[f], weights)


@njit(cache=True, nogil=True)
def _weighted_moments(positions, rest, weights, middle, centre, spread):
    """Computes the weighted centres ``middle`` of positions p and ``centre`` of rest positions r, and the
    covariance ``spread`` = sum w (p - middle) (r - centre)^T / sum w."""
    total = weights.sum()
    middle[:], centre[:], spread[:] = 0.0, 0.0, 0.0
    for n in range(rest.shape[0]):
        for i in range(3):
            middle[i] += weights[n] / total * positions[n, i]
            centre[i] += weights[n] / total * rest[n, i]
    for n in range(rest.shape[0]):
        for i in range(3):
            arm = weights[n] / total * (positions[n, i] - middle[i])
            for j in range(3):
                spread[i, j] += arm * (rest[n, j] - centre[j])


@njit(cache=True, nogil=True)
def _update_weights(positions, rest, turn, move, weights):
    """Sets the weight of each node to 1 / residual. The residual is the distance between the node and its
    rest position moved by the shared motion.
    """
    for n in range(rest.shape[0]):
        square = 0.0
        for i in range(3):
            gap = positions[n, i] - move[i]
            for j in range(3):
                gap -= turn[i, j] * rest[n, j]
            square += gap * gap
        weights[n] = 1.0 / max(np.sqrt(square), _MIN_WEIGHTED_DISTANCE_M)
