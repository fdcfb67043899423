"""Where the nodes and the vertices of a graph shape are at a time."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import GraphPart, GraphShape, Pose, PoseStream, Project, smoothed
from enliven.errors import InputError
from enliven.modeling.mesh import blended
from enliven.rotation import conjugate, from_matrix, multiply, rotate, to_matrix

_MIRRORED = np.array([-1.0, 1.0, 1.0])
"""The diagonal of the reflection in the plane x = 0."""


def graph_pose(project: Project, shape: GraphShape, time: float) -> tuple[Float, Float]:
    """(N, 3, 3) the linear maps and (N, 3) the positions in metres of the nodes of a shape.

    Between two frames both are mixed in proportion. A part that rides is carried rigidly; see
    :class:`enliven.document.possessed.Ride`.

    Raises:
        InputError: for a time that is not finite.
    """
    if not np.isfinite(time):
        raise InputError(f"the time is {time}", where=shape.where, mend="Give seconds.")
    linear, positions = np.empty((len(shape.positions), 3, 3)), np.empty((len(shape.positions), 3))
    for part, start in zip(shape.parts, shape.starts, strict=False):
        maps, places = _played(smoothed(project.streams[part.take], part.smooth), part, time)
        if part.mirrored:
            maps, places = maps * _MIRRORED * _MIRRORED[:, None], places * _MIRRORED
        places = part.size * places
        turn, move = part.turn, part.place
        if part.ride is not None:
            now = from_matrix(linear[part.ride.node])
            carry = multiply(now, conjugate(part.ride.turn))
            move = rotate(carry, move - part.ride.place) + positions[part.ride.node]
            turn = multiply(carry, turn)
        here = slice(start, start + len(part.nodes))
        linear[here] = to_matrix(turn) @ maps @ to_matrix(conjugate(part.axes))
        positions[here] = rotate(turn, places) + move
    return linear, positions


def graph_vertices(shape: GraphShape, linear: Float, positions: Float) -> Float:
    """(V, 3) metres, the vertices for nodes with linear maps (N, 3, 3) at positions (N, 3)."""
    return blended(shape.mesh.vertices, shape.skin, shape.positions, linear, positions)


def pose_of_graph(project: Project, shape: GraphShape, time: float) -> Pose:
    """The pose of a graph shape for the wire and the viewer."""
    linear, positions = graph_pose(project, shape, time)
    return Pose(shape.id, round(time * 1e9), linear.astype(np.float32), positions.astype(np.float32))


def _played(stream: PoseStream, part: GraphPart, time: float) -> tuple[Float, Float]:
    """(K, 3, 3) and (K, 3) of a part's nodes as recorded; as at its first frame where nothing is played."""
    if part.muted:
        return _recorded(stream, part, 0.0)
    at = part.moment(time, stream.duration)
    found = _recorded(stream, part, at.second)
    if at.share > 0.0:
        found = _mixed(found, _recorded(stream, part, at.other), at.share)
    return found if at.weight == 1.0 else _mixed(_recorded(stream, part, 0.0), found, at.weight)


def _recorded(stream: PoseStream, part: GraphPart, second: float) -> tuple[Float, Float]:
    """The same at a second of the stream."""
    last = len(stream.positions) - 1
    frame = min(second / stream.step, float(last))
    before = min(int(frame), max(last - 1, 0))
    after, nodes = min(before + 1, last), part.nodes
    pairs = (stream.linear, stream.positions)
    one, other = (tuple(rows[k, nodes] for rows in pairs) for k in (before, after))
    return _mixed(one, other, frame - before)


def _mixed(one: tuple[Float, ...], other: tuple[Float, ...], share: float) -> tuple[Float, Float]:
    linear, positions = ((1 - share) * a + share * b for a, b in zip(one, other, strict=True))
    return linear, positions
