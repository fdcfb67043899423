"""Samples a character's motion around the playhead in a thread, and caches the samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float, Float32, Int32
from enliven.document import Project, RigBase
from enliven.modeling.edits import get_rig_edits

_MAX_CACHED_FRAMES = 4000
"""Maximum number of cached frames per character: some minutes."""


@dataclass(frozen=True, eq=False)
class SampleRequest:
    """A request for samples.

    Attributes:
        project, character: the current project and character.
        first, last: first and last frame of the trail. Frame k is at ``k * step`` seconds.
        moments: times of the ghosts in seconds.
    """

    project: Project
    character: RigBase
    first: int
    last: int
    step: float
    moments: tuple[float, ...]

    def can_reuse(self, other: SampleRequest) -> bool:
        """Returns True if samples of the other request are valid for this one, because character and takes
        are the same.
        """
        if self.character is not other.character or self.step != other.step:
            return False
        pairs = [(kind, name) for kind, names in self.character.find_needed_ids().items() for name in names]
        project, other_project = self.project, other.project
        return all(
            getattr(project, kind).get(name) is getattr(other_project, kind).get(name) for kind, name in pairs
        )

    def matches(self, other: SampleRequest | None) -> bool:
        """Returns True if both requests are equal."""
        if other is None or not self.can_reuse(other):
            return False
        return (self.first, self.last, self.moments) == (other.first, other.last, other.moments)


@dataclass(frozen=True, eq=False)
class GhostSurface:
    """A character's surface and points at the time of a ghost.

    Attributes:
        rows: (V, 6) float32 position in metres and unit normal of each vertex; empty without a surface.
        faces: (F, 3).
        points: (N, 3) metres: joints, nodes or control points.
    """

    rows: Float32
    faces: Int32
    points: Float


@dataclass(eq=False)
class MotionSamples:
    """The sampled motion of a character.

    Attributes:
        request: the last request.
        points: (N, 3) metres of its joints, nodes or control points, by frame.
        bodies: the ghosts' bodies, by time in seconds.
    """

    request: SampleRequest
    points: dict[int, Float] = field(default_factory=dict)
    bodies: dict[float, GhostSurface] = field(default_factory=dict)
    _compute_points: Callable[[float], Float] | None = None
    _surface: Callable[[float], Float] | None = None

    def place(self, seconds: float) -> Float:
        """Returns the positions (N, 3) in metres at a time, interpolated between two sampled frames."""
        frame_position = seconds / self.request.step
        low = int(np.floor(frame_position))
        lower_point, upper_point = self.points.get(low), self.points.get(low + 1)
        if lower_point is None or upper_point is None:
            nearest = min(self.points, key=lambda frame: abs(frame - frame_position))
            return self.points[nearest]
        return np.asarray(lower_point + (frame_position - low) * (upper_point - lower_point))


def sample_motion(wanted: SampleRequest, before: MotionSamples | None) -> MotionSamples:
    """Returns the requested samples. Reuses valid samples in ``before``.

    Raises:
        EnlivenError: if the character cannot be played.
    """
    if before is not None and wanted.can_reuse(before.request):
        samples = MotionSamples(
            wanted, dict(before.points), dict(before.bodies), before._compute_points, before._surface
        )
    else:
        samples = MotionSamples(wanted)
    if samples._compute_points is None:
        samples._compute_points = _make_point_function(wanted.project, wanted.character)
        samples._surface = get_rig_edits(wanted.character).create_surface_player(
            wanted.project, wanted.character
        )
    if len(samples.points) > _MAX_CACHED_FRAMES:
        samples.points.clear()
    for frame in range(wanted.first, wanted.last + 1):
        if frame not in samples.points:
            samples.points[frame] = samples._compute_points(frame * wanted.step)
    samples.bodies = {moment: samples.bodies[moment] for moment in wanted.moments if moment in samples.bodies}
    assert samples._surface is not None
    for moment in wanted.moments:
        if moment not in samples.bodies:
            samples.bodies[moment] = _make_ghost_surface(
                wanted.character, samples._surface(moment), samples._compute_points(moment)
            )
    return samples


def _make_point_function(project: Project, character: RigBase) -> Callable[[float], Float]:
    """Returns a function that computes the positions (N, 3) of a character's handles at a time in seconds.
    For a character without handles, it computes the positions of the nodes.
    """
    player = get_rig_edits(character).create_player(project, character)

    def at(time: float) -> Float:
        pose, handles = player(time)
        return np.asarray(handles if len(handles) else pose.positions, np.float64)

    return at


def _make_ghost_surface(character: RigBase, vertices: Float, points: Float) -> GhostSurface:
    if character.mesh is None or not len(character.mesh.faces):
        return GhostSurface(np.zeros((0, 6), np.float32), np.zeros((0, 3), np.int32), points)
    faces = character.mesh.faces
    rows = np.concatenate([vertices, smooth_normals(vertices, faces)], 1)
    return GhostSurface(rows.astype(np.float32), faces, points)


def smooth_normals(vertices: Float, faces: Int32) -> Float:
    """Returns (V, 3) unit normals of vertices (V, 3): the area-weighted mean of the face normals.

    The normal of a vertex without a face is 0.
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    corners = faces.ravel()
    sums = [np.bincount(corners, across[:, k], len(vertices)) for k in range(3)]
    normals = np.stack(sums, 1)
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30))
