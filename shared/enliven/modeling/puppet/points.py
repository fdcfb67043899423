"""Edits of a puppet's control points: adds them to the mesh, pairs them with joints, and removes them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document import ControlPoint, ExampleCharacter, Project, PuppetLayer, unused
from enliven.errors import InputError
from enliven.modeling.rig import check_names


def add_point(
    project: Project,
    puppet_id: str,
    vertex: int,
    name: str = "",
    joint: str = "",
    foot: bool = False,
    places: AnyArray | None = None,
) -> Project:
    """Adds a control point at the end of the puppet's list. In each key pose, the control point is on the
    surface.

    Args:
        vertex: the vertex of the mesh that the control point moves.
        name: name that is unique on the puppet. If empty, a name is generated.
        joint: the performer's joint that the control point follows, or "" if there is none.
        foot: True if the puppet can stand on the control point.
        places: (n, 3) metres, the control point's position in each key pose; None to solve the surface for
            it.

    Raises:
        InputError: if the vertex does not exist, has a control point or belongs to no face, or if the name is
            taken.
    """
    puppet = project.puppet(puppet_id)
    points_by_name = {point.name: point for point in puppet.points}
    if name in points_by_name:
        remedy = "Choose another name."
        raise InputError(
            f"another control point already has the name {name!r}", where=_error_place(puppet), remedy=remedy
        )
    vertex = check_vertex(puppet, vertex)
    name = name or unused(f"point {len(points_by_name) + 1}", points_by_name)
    places = surface_places(puppet, vertex) if places is None else places
    poses = [
        replace(pose, places=np.concatenate([pose.places, place[None]]))
        for pose, place in zip(puppet.poses, places, strict=True)
    ]
    point = ControlPoint(name, vertex, joint, bool(foot))
    return project.with_characters(puppet.with_changes(points=(*puppet.points, point), poses=tuple(poses)))


def remove_point(project: Project, puppet_id: str, name: str) -> Project:
    """Removes a control point, its constraints, and layers that moved only this point.

    Raises:
        InputError: if no control point has that name.
    """
    puppet = project.puppet(puppet_id)
    index = puppet.index(name)
    points = tuple(point for point in puppet.points if point.name != name)
    poses = tuple(replace(pose, places=np.delete(pose.places, index, axis=0)) for pose in puppet.poses)
    layers = tuple(_layer_without_point(layer, name) for layer in puppet.layers if layer.points != (name,))
    return project.with_characters(puppet.with_changes(points=points, poses=poses, layers=layers))


def change_point(project: Project, puppet_id: str, point: str, **changes: Any) -> Project:
    """Changes a control point: its ``name``, ``vertex``, ``joint``, ``foot`` flag, or ``weight`` as a handle.

    If the vertex changes, the control point is placed on the surface in each key pose. If the name changes,
    layers and constraints are updated.

    Raises:
        InputError: if no control point has that name, or a value is invalid.
    """
    puppet = project.puppet(puppet_id)
    number = puppet.index(point)
    check_names(changes, ControlPoint, f"control point {point!r}")
    old = puppet.points[number]
    poses = puppet.poses
    if "vertex" in changes and changes["vertex"] != old.vertex:
        changes["vertex"] = check_vertex(puppet, changes["vertex"])
        places = surface_places(puppet, changes["vertex"])
        poses = tuple(
            replace(pose, places=_with_row(pose.places, number, place))
            for pose, place in zip(poses, places, strict=True)
        )
    weight = changes.get("weight")
    if weight is not None and not (np.isfinite(weight) and weight > 0.0):
        remedy = "Pass a weight above 0, or None for a hard control point."
        raise InputError(f"the weight {weight} is not valid", where=f"control point {point!r}", remedy=remedy)
    new = replace(old, **changes)
    points = (*puppet.points[:number], new, *puppet.points[number + 1 :])
    layers = puppet.layers
    if new.name != old.name:
        layers = tuple(_layer_with_renamed_point(layer, old.name, new.name) for layer in layers)
    return project.with_characters(puppet.with_changes(points=points, poses=poses, layers=layers))


def check_vertex(puppet: ExampleCharacter, vertex: int) -> int:
    """Returns a vertex after checking that a control point can be placed on it.

    Raises:
        InputError: if it does not exist, no face uses it, or another control point is on it.
    """
    count = len(puppet.mesh.vertices)
    if not 0 <= vertex < count:
        remedy = f"The vertices of the mesh are numbered 0..{count - 1}."
        raise InputError(f"the mesh has no vertex {vertex}", where=_error_place(puppet), remedy=remedy)
    if not (puppet.mesh.faces == vertex).any():
        problem = f"vertex {vertex} belongs to no face, so no surface would follow the control point"
        raise InputError(
            problem, where=_error_place(puppet), remedy="Choose a vertex that belongs to a face."
        )
    for point in puppet.points:
        if point.vertex == vertex:
            problem = f"vertex {vertex} already has the control point {point.name!r}"
            raise InputError(problem, where=_error_place(puppet), remedy="Choose another vertex.")
    return int(vertex)


def surface_places(puppet: ExampleCharacter, vertex: int) -> Float:
    """Returns the position of a vertex on the solved surface in each key pose, (n, 3) in metres of the mesh's
    frame.
    """
    rest = puppet.mesh.vertices[vertex]
    if not puppet.points or not puppet.poses:
        return np.tile(rest, (len(puppet.poses), 1))
    vertices, weights = zip(*((point.vertex, point.weight) for point in puppet.points), strict=True)
    surface = PuppetSurface(puppet.mesh, vertices, weights, puppet.surface)
    return np.stack([surface.solve_from_rest(pose.places)[vertex] for pose in puppet.poses])


def _error_place(puppet: ExampleCharacter) -> str:
    return f"puppet {puppet.id!r}"


def _with_row(places: AnyArray, number: int, place: Float) -> Float:
    out = np.array(places, np.float64)
    out[number] = place
    return out


def _layer_without_point(layer: PuppetLayer, name: str) -> PuppetLayer:
    """Returns the layer without the control point ``name`` and its constraints."""
    return replace(
        layer,
        points=tuple(other for other in layer.points if other != name),
        positions=tuple(constraint for constraint in layer.positions if constraint.point != name),
        velocities=tuple(constraint for constraint in layer.velocities if constraint.point != name),
        couplings=tuple(
            constraint for constraint in layer.couplings if name not in (constraint.point, constraint.other)
        ),
    )


def _layer_with_renamed_point(layer: PuppetLayer, old: str, new: str) -> PuppetLayer:
    """Returns the layer with the control point ``old`` renamed to ``new``."""

    def name(one: str) -> str:
        return new if one == old else one

    return replace(
        layer,
        points=tuple(name(point) for point in layer.points),
        positions=tuple(replace(constraint, point=name(constraint.point)) for constraint in layer.positions),
        velocities=tuple(
            replace(constraint, point=name(constraint.point)) for constraint in layer.velocities
        ),
        couplings=tuple(
            replace(constraint, point=name(constraint.point), other=name(constraint.other))
            for constraint in layer.couplings
        ),
    )
