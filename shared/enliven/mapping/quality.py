"""The quality of a retargeted motion: pose, stretch, floor contact, foot sliding, and self-intersection.

Pose is the angle between the model's and the performer's limbs (:mod:`enliven.mapping.pose_error`).

Stretch is the length of an edge of the mesh divided by its length at rest. Above ``MAX_STRETCH`` skin begins
to look like a flat sheet. The stretch of a motion is the 99th percentile over all edges and measured times.
Edges of slivers and of tiny separate parts are ignored, because their stretch is not visible.

Floor contact and foot sliding are measured for the body. An object that a hand carries is ignored.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from enliven.arrays import Bool, Float, Int32
from enliven.document import Clip, Project, RiggedCharacter
from enliven.mapping.ground import (
    body_points,
    compute_posed_surfaces,
    floor_height_under,
    leap_heights,
    stands_on_floor,
)
from enliven.mapping.overlap import SelfIntersectionTest
from enliven.mapping.plan import Plan
from enliven.mapping.pose_error import LimbError, limb_errors
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.travel import travel_scale
from enliven.skeletons.anatomy import find_anatomy

MAX_STRETCH = 1.4
"""Largest acceptable value of the 99th percentile of stretch. Above it, hands look like flat sheets. In the
models' own running clips it is 1.1 to 1.5."""
MAX_INTERSECTION = 0.03
"""Largest acceptable fraction of a surface inside other body parts. Models' own clips reach this value."""
MAX_FLOOR_DISTANCE = 0.03
"""Largest acceptable distance of the lowest point from the floor, as a fraction of the height. At larger
distances feet visibly hover."""
MAX_SLIDE_CM_S = 20.0
"""Largest acceptable sliding speed of standing feet in cm/s. Half of the motions in the test data have at
most 8 cm/s."""
MAX_POSE_DEGREES = 8.0
"""Largest acceptable median angle (degrees) between a limb and the performer's limb. Smaller angles are not
noticed."""
MAX_POSE_P90_DEGREES = 15.0
"""Largest acceptable 90th percentile of the angle (degrees) between a limb and the performer's limb."""
_MEASURED_MOMENTS = 24
"""Number of times at which a motion is measured. It is large enough to include a pose that lasts for a
twentieth of the motion."""
_MIN_EDGE_LENGTH = 1e-3
"""Minimum length of an edge with visible stretch, as a fraction of the mesh's size."""
_MIN_TRIANGLE_RATIO = 0.02
"""Minimum ratio of height to length of a triangle. Thinner triangles are slivers, which look like lines on
the screen."""
_MIN_PART_FRACTION = 1e-4
"""Minimum area of a separate part of the mesh, as a fraction of the surface. Smaller parts are ignored as
leftovers of modelling."""
_SAME_VERTEX_DISTANCE = 1e-5
"""Vertices that are closer than this fraction of the mesh's size are treated as one vertex."""
_ON_FLOOR_HEIGHT = 0.03
"""Maximum height of a vertex that counts as on the floor, as a fraction of the shape's height."""
_MIN_LEAP_HEIGHT = 0.005
"""Minimum height of the lowest point in a leap, as a fraction of the shape's height: 8 mm on an adult."""
_SLIDE_INTERVAL_S = 1.0 / 60.0
"""Time in seconds between the two moments that are compared to measure sliding: one frame of common
displays."""
_MIN_STANDING_PERCENT = 10.0
"""The sliding speed is this percentile of the speeds of the vertices near the floor. Faster vertices may
belong to a swinging foot."""
_WITHIN_BOUND_WEIGHT = 0.05
"""Weight of the part of a measure below its bound, relative to the part above the bound."""
_MAX_NAMED_JOINTS = 4
"""Maximum number of overstretched joints, and of pairs of intersecting parts, in a report."""


@dataclass(frozen=True)
class MotionQuality:
    """The measures of a retargeted motion.

    Attributes:
        limbs: the pose error of each limb segment that the take drives; see
            :func:`enliven.mapping.pose_error.limb_errors`.
        stretch: 99th percentile of stretch over all edges and measured times.
        stretch_most: stretch of the edge that is stretched most.
        joints: the joints with the most edges stretched beyond the bound, the worst first.
        sunk: largest depth of the body's lowest point below the floor, as a fraction of the shape's height.
            None if the shape does not stand on the floor.
        afloat: largest height of the lowest point above the floor while the performer stands, as a fraction
            of the shape's height. None if the shape does not stand on the floor.
        slide: speed in cm/s of standing feet over the floor, scaled to the performer's size. None if the
            shape does not travel or has no legs.
        through: largest fraction of the surface inside another part of the body. Faces that are inside at
            rest do not count.
        parts: the pairs of parts that intersect when ``through`` is largest. Parts are named by the joints at
            which their bones begin. The largest intersection is first.
        feet: the joints of the bones that move the lowest point when its distance to the floor is largest.
    """

    stretch: float
    stretch_most: float
    joints: tuple[str, ...]
    sunk: float | None
    afloat: float | None
    slide: float | None
    through: float
    parts: tuple[str, ...]
    feet: tuple[str, ...] = ()
    limbs: tuple[LimbError, ...] = ()

    @property
    def worst_limbs(self) -> tuple[LimbError, ...]:
        """The limb segments with a pose error above a bound, the worst first."""
        beyond = [
            limb for limb in self.limbs if limb.median > MAX_POSE_DEGREES or limb.p90 > MAX_POSE_P90_DEGREES
        ]
        return tuple(sorted(beyond, key=lambda limb: -limb.median))

    @property
    def total_excess(self) -> float:
        """The sum of the relative excess of all measures over their bounds, or 0 if no measure exceeds its
        bound."""
        return sum(max(ratio - 1.0, 0.0) for ratio in self._bound_ratios)

    @property
    def faults(self) -> float:
        """``total_excess``, plus a small term that compares motions within all bounds. Less is better."""
        return self.total_excess + _WITHIN_BOUND_WEIGHT * sum(min(ratio, 1.0) for ratio in self._bound_ratios)

    @property
    def _bound_ratios(self) -> tuple[float, ...]:
        """Each measure divided by its bound: pose, stretch, floor, slide, and self-intersection."""
        floor_distance = max(self.sunk or 0.0, self.afloat or 0.0)
        stretch = (self.stretch - 1.0) / (MAX_STRETCH - 1.0)
        pose = max(
            (max(limb.median / MAX_POSE_DEGREES, limb.p90 / MAX_POSE_P90_DEGREES) for limb in self.limbs),
            default=0.0,
        )
        return (
            pose,
            stretch,
            floor_distance / MAX_FLOOR_DISTANCE,
            (self.slide or 0.0) / MAX_SLIDE_CM_S,
            self.through / MAX_INTERSECTION,
        )

    def __str__(self) -> str:
        phrases = list[str]()
        if self.limbs:
            median, p90 = (
                max(values) for values in zip(*((limb.median, limb.p90) for limb in self.limbs), strict=True)
            )
            phrases.append(
                f"every limb points within {median:.0f}\u00b0 of the performer's (median; 90 % of the time "
                f"within {p90:.0f}\u00b0)"
            )
        phrases.append(
            f"edges stretch by a factor of {self.stretch:.2f} at the 99th percentile, and of "
            f"{self.stretch_most:.1f} at most"
        )
        if self.sunk is not None and self.afloat is not None:
            phrases.append(
                f"the lowest point is at most {self.sunk:.1%} of the model's height below the "
                "floor, and at most "
                f"{self.afloat:.1%} above the floor while the performer stands"
            )
        if self.slide is not None:
            phrases.append(f"feet slide {self.slide:.1f} cm/s")
        return "; ".join([*phrases, f"at most {self.through:.1%} of the surface is inside another part"])


def find_visible_edges(shape: RiggedCharacter) -> tuple[Int32, Float]:
    """Returns the edges (E, 2) of a mesh with visible stretch, and their lengths (E,) in metres at rest.

    Very short edges, and edges that belong only to slivers or tiny parts, are excluded. The result is empty
    for a shape without a mesh.
    """
    if shape.mesh is None:
        return np.empty((0, 2), np.int32), np.empty(0)
    vertices = shape.mesh.vertices
    faces = shape.mesh.faces[_is_visible(shape.mesh.faces, vertices)]
    edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    lengths = _edge_lengths(vertices, edges)
    is_long = lengths > _MIN_EDGE_LENGTH * np.linalg.norm(np.ptp(vertices, axis=0))
    return edges[is_long], lengths[is_long]


def _is_visible(faces: Int32, vertices: Float) -> Bool:
    """Returns (F,) True for faces that are neither slivers nor in a tiny separate part. Without such
    faces, returns True for all."""
    corners = vertices[faces]
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    double_areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    is_wide = double_areas > _MIN_TRIANGLE_RATIO * sides.max(1) ** 2
    # Merge vertices at the same place. Flat-shaded models have one vertex per face, and texture seams have
    # two.
    _, merged_vertex = np.unique(
        np.round(vertices / (_SAME_VERTEX_DISTANCE * max(float(np.ptp(vertices, axis=0).max()), 1e-300))),
        axis=0,
        return_inverse=True,
    )
    merged_vertex = merged_vertex.reshape(-1)
    pairs = merged_vertex[faces[:, [[0, 1], [1, 2]]]].reshape(-1, 2)
    graph = scipy.sparse.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(merged_vertex.max() + 1,) * 2)
    part = scipy.sparse.csgraph.connected_components(graph, directed=False)[1][merged_vertex[faces[:, 0]]]
    is_large = np.bincount(part, double_areas)[part] >= _MIN_PART_FRACTION * double_areas.sum()
    is_visible = is_wide & is_large
    return np.asarray(is_visible if is_visible.any() else np.ones(len(faces), bool))


def stretch_over_time(project: Project, shape_id: str, duration: float) -> tuple[Int32, Float]:
    """Returns the edges (E, 2) of a shape, and their stretch (T, E) at T times within ``duration``
    seconds."""
    edges, rest = find_visible_edges(project.shape(shape_id))
    times = np.linspace(0.0, duration, _MEASURED_MOMENTS)
    return edges, np.array(
        [_edge_lengths(surface, edges) / rest for surface in compute_posed_surfaces(project, shape_id, times)]
    )


def measure_quality(
    project: Project, shape_id: str, clip: Clip, duration: float, plan: Plan | None = None
) -> MotionQuality:
    """Returns the quality of a shape's motion.

    Args:
        project: contains the moving shape.
        shape_id: ID of the shape.
        clip: the performer's take.
        duration: duration of the motion in seconds.
        plan: the mapping that moves the shape. If None, pose errors are not measured.
    """
    shape = project.shape(shape_id)
    edges, stretch = stretch_over_time(project, shape_id, duration)
    limbs = () if plan is None else limb_errors(project, shape_id, clip, plan, duration)
    if not len(edges):
        return MotionQuality(1.0, 1.0, (), None, None, None, 0.0, (), limbs=limbs)
    times = np.linspace(0.0, duration, _MEASURED_MOMENTS)
    sunk, afloat, feet = None, None, ()
    moments, body = list(compute_posed_surfaces(project, shape_id, times)), body_points(shape)
    if stands_on_floor(shape):
        body_height = float(
            np.ptp(moments[0][:, 1]) if shape.mesh is None else np.ptp(shape.mesh.vertices[:, 1])
        )
        heights = (
            np.array([surface[body, 1].min() for surface in moments]) - floor_height_under(shape)
        ) / body_height
        is_standing = np.interp(times, np.arange(len(clip.turns)) * clip.step, leap_heights(clip)) <= 0.0
        sunk, afloat = max(0.0, -float(heights.min())), max(0.0, float(heights[is_standing].max(initial=0.0)))
        worst_moment = int(np.argmax(np.where(is_standing, np.abs(heights), -heights)))
        feet = _find_lowest_joints(shape, np.where(body[:, None], moments[worst_moment], np.inf), body_height)
    through, parts = _self_intersection(shape, moments)
    is_travelling = (
        shape.travel is not None
        and np.ptp(Player(project, shape_id).compute_root(times)[:, [0, 2]], axis=0).any()
    )
    is_walking = is_travelling and stands_on_floor(shape) and bool(find_anatomy(shape.skeleton).legs)
    return MotionQuality(
        float(np.percentile(stretch, 99)),
        float(stretch.max()),
        _find_overstretched_joints(shape, edges, stretch),
        sunk,
        afloat,
        _slide_speed(project, shape, clip, times) if is_walking else None,
        through,
        parts,
        feet,
        limbs,
    )


def _self_intersection(shape: RiggedCharacter, moments: Sequence[Float]) -> tuple[float, tuple[str, ...]]:
    """Returns the largest fraction over time of a surface inside other parts, and the pairs of parts that
    intersect at that time."""
    overlap = SelfIntersectionTest(shape)
    through, parts = max(
        (overlap.measure_overlap(surface) for surface in moments), key=lambda result: result[0]
    )
    names, parents = shape.skeleton.names, np.maximum(shape.skeleton.parents, 0)
    share_by_pair: dict[str, float] = {}
    for (a, b), fraction in parts.items():
        name = f"{names[parents[a]]} in {names[parents[b]]}"
        share_by_pair[name] = share_by_pair.get(name, 0.0) + fraction
    return through, tuple(sorted(share_by_pair, key=lambda name: -share_by_pair[name])[:_MAX_NAMED_JOINTS])


def _edge_lengths(vertices: Float, edges: Int32) -> Float:
    return np.asarray(np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1))


def _find_overstretched_joints(shape: RiggedCharacter, edges: Int32, stretch: Float) -> tuple[str, ...]:
    """Returns the joints of the bones that move the most ends of overstretched edges."""
    overstretched_counts = np.repeat((stretch > MAX_STRETCH).sum(0), 2).astype(float)
    return _joints_that_move(shape, np.asarray(np.bincount(edges.ravel(), overstretched_counts), np.float64))


def _find_lowest_joints(shape: RiggedCharacter, vertices: Float, body_height: float) -> tuple[str, ...]:
    """Returns the joints of the bones that move the lowest vertices of a shape, given its vertices (V, 3)."""
    lowest = float(vertices[:, 1].min())
    return _joints_that_move(shape, (vertices[:, 1] < lowest + _ON_FLOOR_HEIGHT * body_height).astype(float))


def _joints_that_move(shape: RiggedCharacter, count: Float) -> tuple[str, ...]:
    """Returns the joints of the bones that move most of the vertices.

    Args:
        shape: the shape.
        count: (V,) the weight of each vertex.
    """
    if shape.skin is None or not count.any():
        return ()
    weight = np.zeros(len(shape.skeleton))
    for k in range(shape.skin.indices.shape[1]):
        np.add.at(weight, shape.skin.indices[: len(count), k], count * shape.skin.weights[: len(count), k])
    largest = np.argsort(-weight, kind="stable")[:_MAX_NAMED_JOINTS]
    parents = [int(max(shape.skeleton.parents[j], 0)) for j in largest if weight[j] > 0.0]
    return tuple(dict.fromkeys(shape.skeleton.names[j] for j in parents))


def _slide_speed(project: Project, shape: RiggedCharacter, clip: Clip, times: Float) -> float:
    """Returns the mean sliding speed in cm/s of the slowest vertices near the floor, which are in standing
    feet."""
    body_height = 1.0 if shape.mesh is None else float(np.ptp(shape.mesh.vertices[:, 1]))
    floor, body, speeds = floor_height_under(shape), body_points(shape), []
    earlier_surfaces = compute_posed_surfaces(project, shape.id, times[:-1])
    later_surfaces = compute_posed_surfaces(project, shape.id, times[:-1] + _SLIDE_INTERVAL_S)
    for earlier, later in (
        (earlier[body], later[body]) for earlier, later in zip(earlier_surfaces, later_surfaces, strict=True)
    ):
        is_on_floor = min(earlier[:, 1].min(), later[:, 1].min()) < floor + _MIN_LEAP_HEIGHT * body_height
        is_touching = (earlier[:, 1] < floor + _ON_FLOOR_HEIGHT * body_height) & (
            later[:, 1] < floor + _ON_FLOOR_HEIGHT * body_height
        )
        if is_on_floor and is_touching.any():
            distances = np.linalg.norm((later - earlier)[is_touching][:, [0, 2]], axis=1)
            speeds.append(float(np.percentile(distances, _MIN_STANDING_PERCENT)) / _SLIDE_INTERVAL_S)
    scale = travel_scale(shape.with_changes(travel_scale=None), clip)
    return 100.0 * float(np.mean(speeds)) / scale if speeds else 0.0
