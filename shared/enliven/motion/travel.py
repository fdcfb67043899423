"""Root motion: where a take's root went since rest, in the size of the shape that goes along.

height_of(skeleton)                  # metres: what two skeletons' strides are compared by
travel_scale(shape, clip)            # the shape's own, or the ratio of the heights
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.motion.clip import Clip
from enliven.motion.layers import Layer
from enliven.rotation import rotate
from enliven.shape import Shape
from enliven.skeleton import Skeleton

_LOW = 0.15
"""Share of its whole extent below which a root is too near the lowest joint to stand on legs."""


def height_of(skeleton: Skeleton) -> tuple[float, float]:
    """Metres at rest: of the root over the lowest joint (the legs), and the diagonal of the joints' box."""
    low, high = skeleton.positions.min(0), skeleton.positions.max(0)
    return float(skeleton.positions[0, 1] - low[1]), float(np.linalg.norm(high - low))


def travel_scale(shape: Shape, clip: Clip) -> float:
    """How many metres the shape's root goes for a metre of the take's.

    The shape's own ``travel_scale``; or else the ratio of the legs, root over lowest joint, so that feet that
    step the same angle step the same place; or of the whole extents where one of the two has no legs to
    stand on.
    """
    if shape.travel_scale is not None:
        return shape.travel_scale
    (legs, extent), (their_legs, their_extent) = height_of(shape.skeleton), height_of(clip.skeleton)
    if legs > _LOW * extent and their_legs > _LOW * their_extent:
        return legs / their_legs
    return extent / their_extent if their_extent > 0.0 else 1.0


def travelled(root: Float, rest: Float, frames: Float, layer: Layer, scale: float) -> Float:
    """(T, 3) metres that the root went since rest, in the target's axes.

    Args:
        root: (F, 3) metres, the take's root.
        rest: (3,) metres, its rest position.
        frames: (T,) frame numbers.
        layer: its basis turns the way, its weight shortens it.
        scale: of target to source.
    """
    before = np.clip(frames.astype(np.int64), 0, max(len(root) - 2, 0))
    after = np.minimum(before + 1, len(root) - 1)
    part = (frames - before)[:, None]
    at = (1.0 - part) * root[before] + part * root[after]
    way = at - rest
    if layer.mirrored:
        way = way * np.array([-1.0, 1.0, 1.0])
    return np.asarray(rotate(layer.basis, way) * (layer.weight * scale))
