"""Functions for cutting and merging puppets. They solve the surface in key poses and at a time, and add key
poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Bool, Float, Int, Int32
from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document import ControlPoint, ExampleCharacter, KeyPose, Project, PuppetLayer
from enliven.errors import InputError
from enliven.examples.baking.nodes import EdgeGraph
from enliven.examples.puppet_examples import (
    collect_motion_inputs,
    examples_from_key_poses,
    find_missing_examples,
    find_nearest_frame,
)
from enliven.examples.puppet_motion import PuppetState, evaluate_state, loop_position, solve_layer_motion
from enliven.examples.puppet_solve import convert_to_reference
from enliven.meshes import Mesh, weld
from enliven.rotation import conjugate, from_rotation_vector, multiply, normalized, rotate


def surface_of_puppet(puppet: ExampleCharacter) -> PuppetSurface:
    """Returns the solver of the puppet's surface."""
    vertices, weights = [p.vertex for p in puppet.points], [p.weight for p in puppet.points]
    return PuppetSurface(puppet.mesh, vertices, weights, puppet.surface)


def evaluate_puppet_state(project: Project, puppet: ExampleCharacter, time: float) -> PuppetState:
    """Returns :func:`enliven.examples.puppet_motion.evaluate_state`, or the rest state while data is missing.

    Raises:
        InputError: if the time is not finite.
    """
    if not np.isfinite(time):
        raise InputError(
            f"the time {time} is not a finite number",
            where=f"puppet {puppet.id!r}",
            remedy="Pass a finite number of seconds.",
        )
    try:
        return evaluate_state(project, puppet, time)
    except InputError:
        if not find_missing_examples(project, puppet):
            raise
    return evaluate_state(project, puppet.with_changes(layers=()), time)


def convert_to_mesh_frame(puppet: ExampleCharacter, state: PuppetState, place: AnyArray) -> Float:
    """Returns a point (3,) of the world in the mesh's frame, in metres."""
    local = rotate(conjugate(puppet.turn), np.asarray(place) - puppet.place) - state.root
    return rotate(_rotation_about_y(-state.yaw), local)


def solve_surfaces(surface: PuppetSurface, places: Float) -> Float:
    """Returns the solved surface for each of n sets of control point positions (n, P, 3), as vertices (n, V,
    3) in metres of the mesh's frame.
    """
    count = len(surface.mesh.vertices)
    return np.array([surface.solve_from_rest(joint_places) for joint_places in places]).reshape(
        len(places), count, 3
    )


def align_puppet(
    puppet: ExampleCharacter, state: PuppetState, reference: ExampleCharacter, reference_state: PuppetState
) -> ExampleCharacter:
    """Returns the puppet, moved so that two mesh frames coincide: its own in ``state``, and that of the
    puppet ``reference`` in ``reference_state``.
    """
    turn = normalized(
        multiply(_compute_world_rotation(reference, reference_state), _rotation_about_y(-state.yaw))
    )
    place = rotate(reference.turn, reference_state.root) + reference.place - rotate(turn, state.root)
    return puppet.with_changes(turn=turn, place=place)


def add_moment(project: Project, puppet: ExampleCharacter, time: float) -> ExampleCharacter:
    """Adds the puppet's pose at a time as a key pose, so that its parts reproduce this pose.

    The puppet is not changed if several takes contribute to the pose, or if it has that key pose already.
    """
    layer = _find_leading_layer(puppet)
    if layer is None or find_missing_examples(project, puppet):
        return puppet
    motion = solve_layer_motion(project, puppet, puppet.layers.index(layer))
    frame = round(loop_position(layer, motion, time)[0])
    return with_layer_pose(project, puppet, layer, frame)


def with_layer_pose(
    project: Project, puppet: ExampleCharacter, layer: PuppetLayer, frame: int
) -> ExampleCharacter:
    """Adds a layer's pose at a frame of its take as a key pose. If two examples of the puppet would then be
    equal, the puppet stays unchanged.
    """
    motion, take = solve_layer_motion(project, puppet, puppet.layers.index(layer)), project.takes[layer.take]
    frames = [
        find_nearest_frame(project.takes[pose.take], pose.time)
        for pose in puppet.poses
        if pose.take == layer.take
    ]
    if frame in frames:
        return puppet
    return _with_example(project, puppet, KeyPose(layer.take, frame * take.step, motion.places_at(frame)))


def _with_example(project: Project, puppet: ExampleCharacter, pose: KeyPose) -> ExampleCharacter:
    """Adds a key pose, unless two of the puppet's examples would then be equal."""
    more = puppet.with_changes(poses=(*puppet.poses, pose))
    return more if _examples_differ(project, more) else puppet


def remove_symmetry_plane(project: Project, puppet: ExampleCharacter) -> ExampleCharacter:
    """Removes the puppet's symmetry plane.

    For each mirrored key pose, the most similar frame of its take becomes a key pose.
    """
    plain = puppet.with_changes(symmetry=None)
    layer = _find_leading_layer(puppet)
    if puppet.symmetry is None or layer is None or find_missing_examples(project, puppet):
        return plain
    motion = solve_layer_motion(project, puppet, puppet.layers.index(layer))
    examples, took = convert_to_reference(collect_motion_inputs(project, puppet, layer))
    for image in examples.sources[len(puppet.poses) :]:
        frame = int(((took.poses - image) ** 2).sum((1, 2)).argmin())
        pose = KeyPose(layer.take, frame * motion.step, motion.places_at(frame))
        plain = _with_example(project, plain, pose)
    return plain


def find_needed_points(
    puppet: ExampleCharacter,
    old_positions: Float,
    has_old_position: Bool,
    required_vertices: Int | Int32,
    max_count: int,
    tolerance: float,
) -> tuple[list[int], float]:
    """Finds vertices that need a control point so that the surface in the key poses stays the same.

    Args:
        puppet: the puppet with its new mesh. Its control points have the positions of ``old_positions`` in
            its key poses.
        old_positions: (n, V, 3) metres, the old positions of the vertices in the key poses.
        has_old_position: (V,) True for vertices with a known old position that should be kept.
        required_vertices: vertices that get a control point in any case.
        max_count: maximum number of new control points.
        tolerance: maximum error of the surface in metres.

    Returns:
        The vertices, and the remaining error of the surface in metres.
    """
    point_vertices, added = (
        [point.vertex for point in puppet.points],
        [int(vertex) for vertex in required_vertices],
    )
    weights = [point.weight for point in puppet.points]
    surface, asked = PuppetSurface(puppet.mesh, [], None, puppet.surface), np.arange(len(old_positions))
    while True:
        all_held = [*point_vertices, *added]
        if not all_held or not len(old_positions):
            return added, 0.0
        surface.set_control_points(all_held, [*weights, *[None] * len(added)])
        each = (
            np.linalg.norm(
                solve_surfaces(surface, old_positions[asked][:, all_held]) - old_positions[asked], axis=2
            )
            * has_old_position
        )
        off, worst = each.max(0), float(each.max())
        off[all_held] = 0.0
        if worst <= tolerance or len(added) >= max_count or off.max() <= 0.0:
            if len(asked) == len(old_positions):
                return added, worst
            # Finally, check the key poses again that were within the tolerance. The added vertices may have
            # changed them.
            asked, max_count = np.arange(len(old_positions)), 0 if worst > tolerance else max_count
            continue
        asked = asked[each.max(1) > tolerance]
        added += _find_worst_vertices(
            puppet.mesh.vertices, off, tolerance, min(_POINTS_PER_CHECK, max_count - len(added))
        )


def _find_worst_vertices(vertices: Float, off: Float, tolerance: float, count: int) -> list[int]:
    """Returns up to ``count`` vertices with errors above the tolerance, the worst first. Vertices close to a
    chosen vertex are skipped."""
    errors, chosen = off.copy(), list[int]()
    spacing = 0.1 * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    while len(chosen) < count and (not chosen or errors.max() > tolerance):
        chosen.append(int(np.argmax(errors)))
        errors[np.linalg.norm(vertices - vertices[chosen[-1]], axis=1) < spacing] = 0.0
    return chosen


def find_distinguishing_points(project: Project, puppet: ExampleCharacter) -> tuple[ControlPoint, ...]:
    """Returns the control points with joints that have different positions in different key poses. If there
    are none, returns all control points that have a joint.

    The performer's root never moves in the body frame, so its control point is left out.
    """
    paired_points = tuple(point for point in puppet.points if point.joint)
    sources = _joints_at_key_poses(project, puppet)
    if sources is None:
        return paired_points
    moved = np.linalg.norm(np.ptp(sources, axis=0), axis=1)
    names = [point.name for point in puppet.points]
    clear = moved > _MIN_MOTION_FRACTION * max(float(moved.max()), 1e-12)
    return tuple(point for point in paired_points if clear[names.index(point.name)]) or paired_points


def remove_ambiguous_poses(project: Project, puppet: ExampleCharacter) -> tuple[ExampleCharacter, int]:
    """Removes key poses with the same joint positions as an earlier key pose. Returns the puppet and the
    number of removed poses."""
    poses: list[KeyPose] = []
    for pose in puppet.poses:
        tried = puppet.with_changes(poses=(*poses, pose))
        if (
            len(poses) < 1
            or not all(point.joint for point in puppet.points)
            or _examples_differ(project, tried)
        ):
            poses.append(pose)
    return puppet.with_changes(poses=tuple(poses)), len(puppet.poses) - len(poses)


def _examples_differ(project: Project, puppet: ExampleCharacter) -> bool:
    try:
        examples_from_key_poses(project, puppet)
    except InputError:
        return False
    return True


def _joints_at_key_poses(project: Project, puppet: ExampleCharacter) -> Float | None:
    """Returns the positions of the paired joints in the n key poses, (n, P, 3) metres in the body's frame, or
    None without examples.
    """
    try:
        return examples_from_key_poses(project, puppet.with_changes(symmetry=None)).sources
    except InputError:
        return None


def find_nearest_paired(
    mesh: Mesh, points: Sequence[ControlPoint], vertices: Sequence[int]
) -> list[ControlPoint | None]:
    """Returns for each vertex the control point with a joint that is nearest along the surface, or None if no
    control point has a joint."""
    paired = [point for point in points if point.joint]
    if not paired or not vertices:
        return [None] * len(vertices)
    welded, of = weld(mesh)
    away = EdgeGraph(welded).compute_geodesic_distances([int(of[point.vertex]) for point in paired])
    return [paired[int(np.argmin(away[:, of[vertex]]))] for vertex in vertices]


def sample_spread_vertices(
    vertices: Float, among: Int | Int32, known: Sequence[int], count: int
) -> list[int]:
    """Returns up to ``count`` of the vertices ``among`` by farthest point sampling."""
    if not len(among):
        return []
    spots, chosen = vertices[among], list[int]()
    used_places = spots.mean(0)[None] if not len(known) else vertices[list(known)]
    away = np.linalg.norm(spots[:, None] - used_places[None], axis=2).min(1)
    while len(chosen) < count and away.max() > 0.0:
        pick = int(np.argmax(away))
        chosen.append(int(among[pick]))
        away = np.minimum(away, np.linalg.norm(spots - spots[pick], axis=1))
    return chosen


def remove_points_from(layer: PuppetLayer, names: set[str]) -> PuppetLayer:
    """Returns the layer with only the control points that have one of the ``names``."""
    return replace(
        layer,
        points=tuple(name for name in layer.points if name in names),
        positions=tuple(constraint for constraint in layer.positions if constraint.point in names),
        velocities=tuple(constraint for constraint in layer.velocities if constraint.point in names),
        couplings=tuple(
            constraint for constraint in layer.couplings if {constraint.point, constraint.other} <= names
        ),
    )


_POINTS_PER_CHECK = 4
"""Number of control points that are added before the surface is checked again."""
_MIN_MOTION_FRACTION = 0.02
"""A joint that moves less than this fraction of the largest joint motion cannot distinguish key poses."""


def _find_leading_layer(puppet: ExampleCharacter) -> PuppetLayer | None:
    """Returns the layer that alone determines the positions of all control points, or None if several layers
    determine them."""
    layers = [layer for layer in puppet.layers if not layer.muted and layer.weight > 0.0]
    if not layers:
        return None
    top, names = layers[-1], {point.name for point in puppet.points}
    moves_all = top.weight == 1.0 and not top.mirrored and (not top.points or set(top.points) == names)
    return top if moves_all else None


def _compute_world_rotation(puppet: ExampleCharacter, state: PuppetState) -> Float:
    return multiply(puppet.turn, _rotation_about_y(state.yaw))


def _rotation_about_y(angle: float) -> Float:
    return from_rotation_vector(np.array([0.0, angle, 0.0]))
