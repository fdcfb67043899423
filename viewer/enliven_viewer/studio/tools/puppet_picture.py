"""What the puppet tool draws into the picture: control points, arrows, outline, warning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float32, Int32
from enliven_viewer.studio.puppets import middle_of, point_rows, size_of
from enliven_viewer.studio.tools.base import Tool
from enliven_viewer.studio.tools.puppet import PuppetTool

_SEEN_THROUGH = 0.08
"""Of the eye's distance: control points are seen clearly through whatever covers them by less."""
_ALWAYS = 0.8
"""Likewise: the manipulator is covered by nothing."""


@dataclass(frozen=True, eq=False)
class PuppetPicture:
    """What the puppet tool draws over the meshes.

    Attributes:
        crossing: vertices (V, 3) metres in the world and the faces (K, 3) of them that warn, or None.
        ghost: vertices (V, 3), faces and size, metres, of what is outlined, or None.
        tubes: rows of :class:`~enliven_viewer.render.overlay.tubes.Tubes` and their bias, metres.
    """

    crossing: tuple[Float32, Int32] | None = None
    ghost: tuple[Float32, Int32, float] | None = None
    tubes: tuple[tuple[Float32, float], ...] = ()


NOTHING = PuppetPicture()


def picture_of(tool: Tool) -> PuppetPicture:
    """The picture of the active tool; nothing for another tool, or where no puppet is chosen."""
    if not isinstance(tool, PuppetTool):
        return NOTHING
    puppets, lens = tool.puppets, tool.editor.lens
    puppet, standing = puppets.puppet, puppets.shown
    if puppet is None or standing is None:
        return NOTHING
    mesh, warned, ghost = puppet.mesh, puppets.crossing.faces, puppets.stage.ghost
    near = float(np.linalg.norm(standing.out(middle_of(puppet.mesh)[None])[0] - lens.view.eye))
    tubes = [(point_rows(standing, lens, puppets.point, tool.hovered_point), _SEEN_THROUGH * max(near, 0.05))]
    manipulator = tool.manipulator()
    if manipulator is not None:
        part = tool.held.part if tool.held is not None else ""
        away = float(np.linalg.norm(manipulator.place - lens.view.eye))
        tubes.append((manipulator.rows(part or tool.hovered_part, part), _ALWAYS * away))
    return PuppetPicture(
        (standing.solved, mesh.faces[warned]) if puppets.warn and len(warned) else None,
        (ghost.solved, mesh.faces, size_of(mesh)) if ghost is not None else None,
        tuple(tubes),
    )
