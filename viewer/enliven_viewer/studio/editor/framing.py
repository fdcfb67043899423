"""Computes the space that characters occupy during playback, for framing them with the camera."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Project, RigBase
from enliven.modeling.edits import get_rig_edits
from enliven_viewer.studio.viewport.picking import Lens

_COPY_GAP_M = 0.3
"""Gap in metres between a character and the copy next to it, so that both are visible."""
_PATH_SAMPLES = 40
"""Number of sampled times on a character's path. A walk gets several samples per step."""

_MAX_JOINT_DISTANCE = 0.5
"""Maximum distance of a joint from the surface, as a fraction of the surface's longest side. Joints farther
away are control targets of an animation rig.
"""


def sample_path_boxes(project: Project, character: RigBase, time: float, extent: AnyArray) -> Float:
    """Returns the corners (2M, 3) in metres of a character's bounding boxes, sampled over its whole motion.

    Only handles and nodes are played. The margin of the surface around them is assumed constant.

    Args:
        time: time in seconds that `extent` belongs to.
        extent: (N, 3) metres, points of its surface at that time.
    """
    player = get_rig_edits(character).create_player(project, character)
    end = project.end_of(character)
    moments = np.linspace(0.0, end, _PATH_SAMPLES) if end > 0.0 else [0.0]

    def box(seconds: float) -> Float:
        pose, handles = player(seconds)
        places = np.concatenate([pose.positions, handles])[is_near]
        return np.stack([places.min(0), places.max(0)])

    is_near = _find_near_points(np.concatenate([player(time)[0].positions, player(time)[1]]), extent)

    beyond = np.stack([extent.min(0), extent.max(0)]) - box(time)
    return np.concatenate([box(float(moment)) + beyond for moment in moments])


def find_visible_points(extent: AnyArray, vertices: AnyArray) -> AnyArray:
    """Returns the points of a character that must be visible: its surface and the handles near it.

    Joints far from the surface, such as the control targets of an animation rig, are left out.
    """
    return (
        np.concatenate([vertices, extent[_find_near_points(extent, vertices)]]) if len(vertices) else extent
    )


def _find_near_points(places: AnyArray, extent: AnyArray) -> AnyArray:
    """Returns an (N,) mask of the points ``places`` (N, 3) that are within half of the surface's size of the
    surface. All are True without a surface.
    """
    low, high = extent.min(0), extent.max(0)
    air = _MAX_JOINT_DISTANCE * float((high - low).max())
    is_near = ((places >= low - air) & (places <= high + air)).all(1)
    return is_near if is_near.any() else np.ones(len(places), bool)


def find_side_offset(lens: Lens, characters: Sequence[RigBase]) -> Float:
    """Returns an offset (3,) in metres to the right of the view, by about the width of the characters."""
    right = lens.view.camera_from_world[0, :3]
    width = max(float(np.ptp(get_rig_edits(character).rest(character) @ right)) for character in characters)
    spread = float(np.ptp([get_rig_edits(character).centre(character) @ right for character in characters]))
    offset = np.asarray(right * (width + spread + _COPY_GAP_M))
    offset[1] = 0.0
    return offset
