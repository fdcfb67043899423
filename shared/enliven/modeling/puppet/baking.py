"""Puppets baked to possessed meshes, which can be cut and merged (:mod:`enliven.modeling.possessed.surgery`).

    project, graph_id, error = bake_puppet(project, "cactus")

The puppet's motion is kept within the stated error; its examples are not. Undo brings them back.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import GraphPart, GraphShape, PoseStream, Project, Puppet, unused
from enliven.errors import InputError
from enliven.examples.baking import (
    BakedSurface,
    BakeError,
    BakeSettings,
    SurfaceFrames,
    bake_surface,
    states_of,
)
from enliven.meshes import Mesh
from enliven.rotation import rotate, to_matrix


def bake_puppet(
    project: Project,
    puppet_id: str,
    start: float = 0.0,
    end: float | None = None,
    rate: float = 30.0,
    *,
    keep: bool = False,
    settings: BakeSettings | None = None,
) -> tuple[Project, str, BakeError]:
    """A project with a possessed mesh that does what a puppet does, its id, and how far off it is.

    It takes the puppet's place and id; where the puppet is kept, it gets a new one.

    Raises:
        InputError: as :func:`baked`.
    """
    puppet = project.puppet(puppet_id)
    rest = project if keep else project.without(puppet_id)
    graph_id = unused(puppet_id, rest.characters)
    stream_id = unused(puppet_id, project.streams)
    graph, stream, error = baked(project, puppet, start, end, rate, (graph_id, stream_id), settings)
    return rest.with_streams(stream).with_characters(graph), graph_id, error


def baked(
    project: Project,
    puppet: Puppet,
    start: float = 0.0,
    end: float | None = None,
    rate: float = 30.0,
    ids: tuple[str, str] | None = None,
    settings: BakeSettings | None = None,
) -> tuple[GraphShape, PoseStream, BakeError]:
    """The motion of a puppet from ``start`` to ``end`` seconds, as nodes that a mesh follows.

    Args:
        end: None takes the end of the last of its layers.
        rate: frames a second.
        ids: of the shape and its stream; None for the puppet's.
        settings: how closely.

    Raises:
        InputError: where the times make no sense, or the puppet lacks something to move.
    """
    settings = settings or BakeSettings()
    stop = project.end_of(puppet) if end is None else end
    times = frame_times(start, stop, rate, puppet.id)
    places, turns, roots = states_of(project, puppet, times)
    frames = SurfaceFrames(puppet, places, settings.kept)
    held = [point.vertex for point in puppet.points]
    surface = bake_surface(puppet.mesh, frames, places, held, settings)
    ids = (puppet.id, puppet.id) if ids is None else ids
    graph, stream = graph_of(puppet.mesh, surface, turns, roots, 1.0 / rate, ids, start)
    return graph, stream, surface.error


def graph_of(
    mesh: Mesh,
    surface: BakedSurface,
    turns: Float,
    places: Float,
    step: float,
    ids: tuple[str, str],
    start: float = 0.0,
) -> tuple[GraphShape, PoseStream]:
    """A baked surface as a shape and its stream.

    Args:
        turns, places: (F, 4) and (F, 3), where the mesh's frame is in the world.
        step: seconds from frame to frame.
        ids: of the shape and of the stream.
        start: seconds of the project's time at which it begins.
    """
    linear = to_matrix(turns)[:, None] @ surface.linear
    positions = rotate(turns[:, None], surface.places) + places[:, None]
    stream = PoseStream(ids[1], linear, positions, step)
    part = GraphPart(ids[1], np.arange(len(surface.pivots)), offset=start)
    return GraphShape(ids[0], surface.pivots, surface.edges, mesh, surface.skin, (part,)), stream


def frame_times(start: float, end: float, rate: float, name: str) -> Float:
    """(T,) seconds from start to end.

    Raises:
        InputError: where they make no sense.
    """
    if not (np.isfinite([start, end, rate]).all() and end >= start and 0 < rate <= 1000):
        what = f"from {start} s to {end} s at {rate} frames a second is no time"
        raise InputError(what, where=f"shape {name!r}", mend="Give an end after the start.")
    return np.asarray(start + np.arange(round((end - start) * rate) + 1) / rate)
