"""Messages with solved surfaces. They are needed because pages cannot solve meshes that control
points drive.
"""

from __future__ import annotations

import msgspec
import numpy as np

from enliven.arrays import Float32
from enliven.wire import pack_topic

_STEPS = 65535
"""Largest value of a quantised coordinate. The resolution of a surface of 2 m is 0.03 mm."""
_MIN_STEP_M = 1e-9
"""Minimum step in metres, so that a flat surface needs no special case."""


def pack_surface(character: str, revision: int, vertices: Float32) -> bytes:
    """Returns the message with the solved vertices (V, 3), in metres of the world.

    The message contains the topic "surface", a zero byte, the version, and an array in MessagePack: the
    character's id, its revision, the lowest corner (3 metres), the step in metres, and (V, 3) uint16 steps
    from that corner.
    """
    low = vertices.min(0).astype(np.float64)
    step = max(float((vertices.max(0) - low).max()) / _STEPS, _MIN_STEP_M)
    steps = np.rint((vertices - low) / step).clip(0, _STEPS).astype("<u2")
    fields = [character, revision, low.tolist(), step, steps.tobytes()]
    return pack_topic("surface", msgspec.msgpack.encode(fields))
