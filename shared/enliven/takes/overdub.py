"""Overdub: adds a live or recorded performance to a possessed mesh that already has motion. The new motion
becomes a layer in the rest space of the mesh.

The nodes and the placement of the mesh on the stage differ from the nodes and the placement of the project's
mesh. The rigid motion that most nodes on the stage share is removed, so that parts that no performer moved
are static. The remaining motion is transferred to the nodes of the project's mesh.
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
from enliven.modeling.possessed.even_steps import even_times, interpolate_linearly
from enliven.modeling.possessed.pose import compose_with_base
from enliven.similarity import Similarity, fit_similarity
from enliven.takes.body_takes import RecordedHolds
from enliven.takes.punch_in import PunchIn
from enliven.takes.shared_motion import find_shared_motion

_SAME_NODE_M = 2e-3
"""Maximum distance, metres, between two equal nodes. It allows for the quantization of transmitted poses."""


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


def add_overdub_layer(
    project: Project,
    shape: GraphCharacter,
    key: tuple[str, int],
    character: Character,
    poses: list[Pose],
    begin: int,
    holds: RecordedHolds | None,
    punch: PunchIn | None,
) -> Project:
    """Adds a performance to a possessed mesh as an additional layer. Returns the edited project.

    Args:
        key: the id and the revision of the character on the stage.
        begin: time of the sensor's clock at 0 seconds of the project, nanoseconds.
        punch: the time span in which all other motion of the mesh is muted. None mutes nothing.

    Raises:
        InputError: if the poses are inconsistent.
    """
    used_poses, seconds, grid = even_times(character, poses, begin)
    values = ([pose.linear for pose in used_poses], [pose.positions for pose in used_poses])
    linear, positions = (
        interpolate_linearly(np.array(values_of_track, np.float64), seconds, grid)
        for values_of_track in values
    )
    maps, offsets = OverdubTransfer(shape, character)(linear, positions)
    stream = PoseStream(
        unused(f"{shape.id} over", project.streams), maps, shape.positions + offsets, float(grid[1] - grid[0])
    )
    possession = None if holds is None else holds.possession(key, character, poses)
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
