"""Possessed meshes copied, moved, scaled and mirrored, with their motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import GraphShape, Project, same, unused
from enliven.errors import InputError
from enliven.modeling.rigged import Axes, checked_motion, moved_mesh
from enliven.rotation import IDENTITY, multiply, normalized, rotate


def copy_graph(project: Project, shape_id: str, *, delay: float = 0.0) -> tuple[Project, str]:
    """A project with a copy of a possessed mesh, which moves ``delay`` seconds later, and its id."""
    return paste_graph(project, project, shape_id, delay=delay)


def paste_graph(
    project: Project, source: Project, shape_id: str, *, delay: float = 0.0
) -> tuple[Project, str]:
    """A project with a copy of a possessed mesh of another project (or a take, by
    :func:`enliven.takes.possessed.read_possessed`), with its motion, and the copy's id.

    Streams that the project has already, bit for bit, are used; others come along.

    Raises:
        InputError: where there is no such shape, or the delay is no number.
    """
    shape = source.graph(shape_id)
    ids: dict[str, str] = {}
    for part in shape.parts:
        stream = source.streams[part.stream]
        if part.stream not in ids and not same(project.streams.get(stream.id), stream):
            stream = replace(stream, id=unused(stream.id, project.streams))
            project = project.with_streams(stream)
        ids.setdefault(part.stream, stream.id)
    copy_id = unused(shape_id, {**project.shapes, **project.graphs, **project.puppets})
    parts = tuple(replace(part, stream=ids[part.stream]).later(delay) for part in shape.parts)
    return project.with_graphs(shape.with_changes(id=copy_id, parts=parts)), copy_id


def move_graph(
    project: Project,
    shape_id: str,
    offset: AnyArray,
    turn: AnyArray = IDENTITY,
    about: AnyArray | None = None,
) -> Project:
    """A project with a possessed mesh moved at every time: x becomes turn (x - about) + about + offset.

    Args:
        offset: (3,) metres.
        turn: (4,) rotation.
        about: (3,) metres that the turn leaves; None the origin.

    Raises:
        InputError: where there is no such shape, or a number is not finite.
    """
    shape = project.graph(shape_id)
    offset, turn, centre = checked_motion(offset, turn, about, f"graph shape {shape_id!r}")
    parts = tuple(
        part
        if part.ride is not None
        else replace(
            part,
            turn=normalized(multiply(turn, part.turn)),
            place=rotate(turn, part.place - centre) + centre + offset,
        )
        for part in shape.parts
    )
    return project.with_graphs(shape.with_changes(parts=parts))


def scale_graph(project: Project, shape_id: str, factor: float) -> Project:
    """A project with a possessed mesh ``factor`` times as large, at every time, about its node 0 at rest.

    Raises:
        InputError: where there is no such shape, the factor is not above zero, or a part of it rides (scale
            the parts before they are merged).
    """
    shape = project.graph(shape_id)
    where = f"graph shape {shape_id!r}"
    if not (np.isfinite(factor) and factor > 0.0):
        raise InputError(f"it cannot be {factor} times as large", where=where, mend="Give a number above 0.")
    centre = _alone(shape, where)
    parts = tuple(
        replace(part, size=part.size * factor, place=centre + factor * (part.place - centre))
        for part in shape.parts
    )
    vertices = centre + factor * (shape.mesh.vertices - centre)
    positions = centre + factor * (shape.positions - centre)
    mesh = replace(shape.mesh, vertices=vertices)
    return project.with_graphs(shape.with_changes(positions=positions, mesh=mesh, parts=parts))


def mirror_graph(project: Project, shape_id: str, normal: AnyArray) -> Project:
    """A project with a possessed mesh mirrored, at every time, in the plane through its node 0 at rest at
    right angles to ``normal`` (3,).

    Raises:
        InputError: where there is no such shape, no direction, or a part of it rides.
    """
    shape = project.graph(shape_id)
    axes, centre = Axes.mirror(normal), _alone(shape, f"graph shape {shape_id!r}")
    flip = Axes(IDENTITY, True)
    parts = []
    for part in shape.parts:
        # M (turn S^k x + place) = (M turn S) S^(k+1) x + M place, and M turn S is a rotation again.
        turn = normalized(multiply(axes.turn, flip.rotations(part.turn)))
        rest = normalized(multiply(axes.turn, flip.rotations(part.axes)))
        place = centre + axes.vectors(part.place - centre)
        parts.append(replace(part, turn=turn, axes=rest, place=place, mirrored=not part.mirrored))
    mesh = moved_mesh(shape.mesh, centre, axes, centre)
    positions = centre + axes.vectors(shape.positions - centre)
    return project.with_graphs(shape.with_changes(positions=positions, mesh=mesh, parts=tuple(parts)))


def _alone(shape: GraphShape, where: str) -> Float:
    """(3,) metres, node 0 at rest; refuses a shape with parts that ride, which hold places of their own."""
    if any(part.ride is not None for part in shape.parts):
        mend = "Do it before the merge."
        raise InputError("a part of it rides on another", where=where, mend=mend)
    return np.asarray(shape.positions[0])
