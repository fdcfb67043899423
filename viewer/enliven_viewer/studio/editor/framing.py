"""How much room characters take while they play, so that the camera can take in all of it."""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Project, RigBase
from enliven.modeling.edits import rig_of

_MOMENTS = 40
"""Moments at which the way of a character is looked at: some of each step of a walk."""

_STRAY = 0.5
"""Share of a surface's longest side: a joint farther off it is a target of an animator's rig, not a limb."""


def way_of(project: Project, character: RigBase, time: float, extent: AnyArray) -> Float:
    """Returns (2M, 3) metres, the corners of the boxes that a character fills at moments of all that it
    plays.

    Its handles and nodes are played; what its surface has beyond them now, it is taken to have always.

    Args:
        time: seconds, when the surface is as ``extent`` says.
        extent: (N, 3) metres, the places of its surface at that time.
    """
    player = rig_of(character).player(project, character)
    end = project.end_of(character)
    moments = np.linspace(0.0, end, _MOMENTS) if end > 0.0 else [0.0]

    def box(seconds: float) -> Float:
        pose, handles = player(seconds)
        places = np.concatenate([pose.positions, handles])[near]
        return np.stack([places.min(0), places.max(0)])

    near = _near(np.concatenate([player(time)[0].positions, player(time)[1]]), extent)

    beyond = np.stack([extent.min(0), extent.max(0)]) - box(time)
    return np.concatenate([box(float(one)) + beyond for one in moments])


def seen_points(extent: AnyArray, vertices: AnyArray) -> AnyArray:
    """Returns the points of a character that a camera has to show: its surface and the handles near it.

    Joints far off the surface, such as the targets of an animator's rig, do not count.
    """
    return np.concatenate([vertices, extent[_near(extent, vertices)]]) if len(vertices) else extent


def _near(places: AnyArray, extent: AnyArray) -> AnyArray:
    """Returns which (N, 3) places lie no farther off a surface than half of its size; all if none does."""
    low, high = extent.min(0), extent.max(0)
    air = _STRAY * float((high - low).max())
    near = ((places >= low - air) & (places <= high + air)).all(1)
    return near if near.any() else np.ones(len(places), bool)
