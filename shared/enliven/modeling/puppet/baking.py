"""Bakes puppets (meshes driven by example poses) to possessed meshes.

    project, graph_id, error = bake_puppet(project, "cactus")

Possessed meshes can be cut and merged (:mod:`enliven.modeling.possessed.surgery`). The baked motion differs
from the puppet's motion by the returned error. The examples are lost, but undo restores them.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import ExampleCharacter, GraphCharacter, GraphPart, PoseStream, Project, unused
from enliven.errors import InputError
from enliven.examples.baking.bake import BakedSurface, bake_surface
from enliven.examples.baking.frames import SurfaceFrames, evaluate_states
from enliven.examples.baking.settings import MAX_CACHED_FRAMES_MB, BakeError, BakeSettings
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
    """Bakes a puppet to a possessed mesh. Returns the project, the mesh's id, and the error.

    The mesh replaces the puppet and gets its id. If the puppet is kept, the mesh gets a new id.

    Raises:
        InputError: in the same cases as :func:`bake_motion`.
    """
    puppet = project.puppet(puppet_id)
    rest = project if keep else project.drop_character(puppet_id)
    graph_id = unused(puppet_id, rest.characters)
    stream_id = unused(puppet_id, project.streams)
    graph, stream, error = bake_motion(project, puppet, start, end, rate, (graph_id, stream_id), settings)
    return rest.with_streams(stream).with_characters(graph), graph_id, error


def bake_motion(
    project: Project,
    puppet: ExampleCharacter,
    start: float = 0.0,
    end: float | None = None,
    rate: float = 30.0,
    ids: tuple[str, str] | None = None,
    settings: BakeSettings | None = None,
) -> tuple[GraphCharacter, PoseStream, BakeError]:
    """Bakes the motion of a puppet from ``start`` to ``end`` seconds to nodes that a mesh follows.

    Args:
        end: end in seconds, or None for the end of the puppet's last layer.
        rate: frames per second.
        ids: the ids of the shape and its stream; None for the puppet's ids.
        settings: accuracy of the result.

    Raises:
        InputError: if the times are invalid, or the puppet lacks data that it needs to move.
    """
    settings = settings or BakeSettings()
    stop = project.end_of(puppet) if end is None else end
    times = frame_times(start, stop, rate, puppet.id)
    places, turns, roots = evaluate_states(project, puppet, times)
    frames = SurfaceFrames(puppet, places, MAX_CACHED_FRAMES_MB)
    point_vertices = [point.vertex for point in puppet.points]
    surface = bake_surface(puppet.mesh, frames, places, point_vertices, settings)
    ids = (puppet.id, puppet.id) if ids is None else ids
    graph, stream = graph_from_baked_surface(puppet.mesh, surface, turns, roots, 1.0 / rate, ids, start)
    return graph, stream, surface.error


def graph_from_baked_surface(
    mesh: Mesh,
    surface: BakedSurface,
    turns: Float,
    places: Float,
    step: float,
    ids: tuple[str, str],
    start: float = 0.0,
) -> tuple[GraphCharacter, PoseStream]:
    """Converts a baked surface to a shape and its stream.

    Args:
        turns, places: (F, 4) and (F, 3), the world pose of the mesh's frame.
        step: seconds from frame to frame.
        ids: the ids of the shape and of the stream.
        start: time of the project in seconds at which the motion begins.
    """
    linear = to_matrix(turns)[:, None] @ surface.linear
    positions = rotate(turns[:, None], surface.places) + places[:, None]
    stream = PoseStream(ids[1], linear, positions, step)
    part = GraphPart(ids[1], np.arange(len(surface.pivots)), offset=start)
    return GraphCharacter(ids[0], surface.pivots, surface.edges, mesh, surface.skin, (part,)), stream


def frame_times(start: float, end: float, rate: float, name: str) -> Float:
    """Returns (T,) the frame times in seconds from ``start`` to ``end``, at ``rate`` frames per second.

    Raises:
        InputError: if the times are invalid.
    """
    if not (np.isfinite([start, end, rate]).all() and end >= start and 0 < rate <= 1000):
        problem = f"the time range from {start} s to {end} s at {rate} frames per second is not valid"
        raise InputError(
            problem,
            where=f"shape {name!r}",
            remedy="Choose an end after the start, and a frame rate above 0.",
        )
    return np.asarray(start + np.arange(round((end - start) * rate) + 1) / rate)
