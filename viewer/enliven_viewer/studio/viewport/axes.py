"""Draws small world axes in a corner of a view: x red, y green, z blue, like the arrows of the gizmo."""

from __future__ import annotations

import numpy as np

from enliven_viewer.studio.viewport.overlay import Disc, Label, Line, Point
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.theme import AXIS_COLOURS, Colour

_AXIS_LENGTH_PX = 24.0
"""Length of an axis in pixels."""


def make_axes_marks(lens: Lens, at: Point) -> tuple[Line | Disc | Label, ...]:
    """Returns marks of the world axes as seen in a view, centred at a pixel. Axes that point
    away come first.
    """
    seen = lens.view.camera_from_world[:3, :3]
    marks: list[Line | Disc | Label] = []
    for axis in sorted(range(3), key=lambda k: seen[2, k]):
        right, up, nearer = (float(value) for value in seen[:, axis])
        red, green, blue = AXIS_COLOURS[axis]
        tint: Colour = (red / 255, green / 255, blue / 255, 0.55 if nearer < -0.15 else 1.0)
        end = (at[0] + _AXIS_LENGTH_PX * right, at[1] - _AXIS_LENGTH_PX * up)
        marks.append(Line((at, end), tint, 2.4))
        if np.hypot(right, up) > 0.3:
            marks.append(Label((end[0] + 7 * right - 3, end[1] - 8 * up), "xyz"[axis], tint))
        else:
            marks.append(Disc(end, 2.5, tint))
    return tuple(marks)
