"""Retargets like Python animation add-ons: frame by frame, bone by bone, constraint by constraint.

Every bone's constraint reads the posed source at the two ends of its interval, blends the neighbouring source
bones there, and applies the difference to the target. Then the bone is attached to its parent. It uses small
NumPy arrays, and no compiled code of ours.
"""

from __future__ import annotations

import math

import numpy as np

from enliven.document.project import Project
from enliven.motion.layers.travel import travel_scale


def evaluated(project: Project, shape_id: str, times: np.ndarray) -> np.ndarray:
    """Returns (T, N, 3) joints of a shape at ``times`` (T,), for layers of weight 1 that are played once."""
    shape = project.shape(shape_id)
    return np.array([_frame(project, shape, float(t)) for t in times])


def _frame(project, shape, seconds):
    posed = {}
    for layer in shape.layers:
        posed[layer.id] = _pose_source(project.takes[layer.take], layer, seconds)
    skeleton = shape.skeleton
    joints, matrices = np.empty((len(skeleton), 3)), [None] * len(skeleton)
    travel = shape.layer(shape.travel)
    clip = project.takes[travel.take]
    way = posed[travel.id][2] - clip.skeleton.positions[0]
    way = _matrix(travel.basis) @ way * travel_scale(shape, clip)
    for j, parent in enumerate(skeleton.parents):
        own = _matrix(shape.modeling[j])
        for span in shape.spans[j]:
            first = last = np.array([1.0, 0.0, 0.0, 0.0])
            for ref in span.refs:
                first = _times(first, _rotation_at(posed[ref.layer], ref.start))
                last = _times(last, _rotation_at(posed[ref.layer], ref.end))
            own = own @ _matrix(_times(_invert_quaternion(first), last))
        if parent < 0:
            matrices[j] = own
            joints[j] = skeleton.positions[0] + shape.place + way
        else:
            matrices[j] = matrices[parent] @ own
            joints[j] = joints[parent] + matrices[j] @ skeleton.vectors[j]
    return joints


def _pose_source(clip, layer, seconds):
    """Returns the source at a time: arc length at the joints of its chain, rotations there, and the root's
    position.
    """
    frame = min(max((seconds - layer.offset) * layer.speed / clip.step, 0.0), len(clip.turns) - 1.0)
    low = min(int(frame), len(clip.turns) - 2)
    part = frame - low
    root = (1 - part) * clip.root[low] + part * clip.root[low + 1]
    knots, arc = [np.array([1.0, 0.0, 0.0, 0.0])], [0.0]
    if len(layer.chain) == 1:
        joint = layer.chain[0]
        knots.append(_slerp(clip.turns[low, joint], clip.turns[low + 1, joint], part))
        arc.append(1.0)
    else:
        first = layer.chain[0]
        start = _invert_quaternion(_slerp(clip.turns[low, first], clip.turns[low + 1, first], part))
        for joint in layer.chain[1:]:
            turn = _slerp(clip.turns[low, joint], clip.turns[low + 1, joint], part)
            knots.append(_times(start, turn))
            arc.append(arc[-1] + float(np.linalg.norm(clip.skeleton.vectors[joint])))
    basis = layer.basis
    turned = [_times(_times(basis, knot), _invert_quaternion(basis)) for knot in knots]
    return np.array(arc) / arc[-1], turned, root


def _rotation_at(posed, s):
    """Returns the rotation accumulated up to arc length ``s``."""
    arc, knots, _ = posed
    k = min(int(np.searchsorted(arc, s, side="right")) - 1, len(arc) - 2)
    return _slerp(knots[k], knots[k + 1], (s - arc[k]) / (arc[k + 1] - arc[k]))


def _times(a, b):
    w, x, y, z = a
    e, f, g, h = b
    return np.array(
        [
            w * e - x * f - y * g - z * h,
            w * f + x * e + y * h - z * g,
            w * g - x * h + y * e + z * f,
            w * h + x * g - y * f + z * e,
        ]
    )


def _invert_quaternion(q):
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def _slerp(a, b, t):
    cosine = float(a @ b)
    if cosine < 0:
        b, cosine = -b, -cosine
    angle = math.acos(min(cosine, 1.0))
    if angle < 1e-8:
        return (1 - t) * a + t * b
    return (math.sin((1 - t) * angle) * a + math.sin(t * angle) * b) / math.sin(angle)


def _matrix(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
