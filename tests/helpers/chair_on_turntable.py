"""A small chair on a turntable, a room with corners in view, and a nearly static camera."""

from dataclasses import replace

import numpy as np

from enliven.samples.shipped import load_sample
from enliven_synthesis.sensor.handheld import HandheldPath
from enliven_synthesis.sensor.scene import Box
from enliven_synthesis.sensor.turntable_object import TurntablePath

_CHAIR = load_sample("chair")
_MIDDLE = np.mean(_CHAIR.bounds, axis=0) * [1, 0, 1] + [0, _CHAIR.bounds[0][1], 0]
SCANNED_OBJECT = replace(_CHAIR, vertices=0.5 * (_CHAIR.vertices - _MIDDLE))
CAMERA_PATH = TurntablePath(begins=1.5, period=12.0)
SETTLED = HandheldPath(target=(0.0, 0.2, 0.0), radius=1.5, height=(1.1, 1.1), turns=0.0, sway=0.02, shake=0.0)
HELD = replace(SETTLED, target=(0.0, 0.62, 0.0))
"""The same camera path for a chair that is lifted by a quarter of a metre."""
LEVEL = replace(SETTLED, target=(0.0, 1.05, 0.0))
"""The same path with a level camera: it does not see the floor within two metres."""
ROOM = (
    Box((-3.0, -0.1, -3.0), (3.0, 0.0, 3.0)),
    Box((-3.0, 0.0, -1.1), (3.0, 2.5, -1.0)),
    Box((0.5, 0.0, -1.0), (0.9, 0.8, -0.5)),
    Box((-1.0, 0.0, -1.0), (-0.6, 0.5, -0.4)),
    Box((-0.3, 0.0, -1.0), (0.2, 0.3, -0.8)),
)
