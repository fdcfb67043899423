"""Moves the view to the limb that the next possession attaches, and back. A second view shows the limb from
the side.
"""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float
from enliven_viewer.playback.document import find_bounds
from enliven_viewer.render.camera import Box, OrbitCamera
from enliven_viewer.render.scene import Scene, SceneCharacter
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.viewport.picking import Lens

_FRAMING_MARGIN = 1.7
"""Size of the view relative to the limb, so that adjacent parts are visible too."""
_MAX_PART_FRACTION = 0.75
"""If the part to be attached is larger than this fraction of the character, the view does not move."""
_MIN_STAY_S = 0.7
"""Minimum time in seconds that the view stays at a limb, so that it does not jump between two limbs with
similar scores.
"""
_MIN_LIMB_MOVEMENT = 0.35
"""Minimum movement of a limb, as a fraction of its size, before the view follows."""
_VIEW_TOLERANCE = 1e-6
"""Change of the view, in metres and radians, above which the artist must have moved it."""


class CloseUp:
    """The automatic movement of the editor's camera while a performer chooses what to control.

    Attributes:
        is_on: whether the view moves to the limb.
        box: bounding box of the limb in metres; None if no limb is about to be attached.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.is_on = False
        self.box: Box | None = None
        self._previous_view: tuple[float, ...] | None = None
        self._own_view: tuple[float, ...] = ()
        self._framed_limb: Box | None = None
        self._framed_for_s = 0.0

    def toggle(self) -> None:
        """Switches the automatic view on or off."""
        self.is_on = not self.is_on

    def advance(self, seconds: float, scene: Scene | None, character_id: str | None) -> None:
        """Moves the view to the part that the next possession attaches. ``character_id`` restricts this to
        one character.
        """
        self._framed_for_s += seconds
        box = None if scene is None or not self.is_on else find_pending_limb_box(scene, character_id)
        if (
            box is None
            and self.box is not None
            and self.is_on
            and scene is not None
            and self._framed_for_s < _MIN_STAY_S
        ):
            return
        self.box = box
        if box is None:
            self._go_back()
        elif self._framed_limb is None or (
            self._framed_for_s > _MIN_STAY_S and _has_moved(box, self._framed_limb)
        ):
            self._go_to(box)

    def lens(self, width: float, height: float) -> Lens | None:
        """Returns the side view of the limb for an image of ``width`` x ``height`` pixels, or None without a
        limb.
        """
        if self.box is None:
            return None
        camera = OrbitCamera(self.editor.camera.field_of_view)
        azimuth, elevation = self.editor.camera.goal[3:5]
        camera.face(azimuth + math.pi / 2, elevation)
        camera.frame(self.box, width / height, at_once=True, margin=_FRAMING_MARGIN)
        return Lens(camera.view(width / height), (width, height))

    @property
    def _view_was_turned(self) -> bool:
        """Returns True if the artist has moved the view since it was sent to the limb."""
        return not np.allclose(self.editor.camera.goal, self._own_view, atol=_VIEW_TOLERANCE)

    def _go_to(self, box: Box) -> None:
        """Frames a limb, unless the artist has moved the view meanwhile."""
        camera, size = self.editor.camera, self.editor.size
        if self._framed_limb is not None and self._view_was_turned:
            self._previous_view = None
        else:
            if self._framed_limb is None:
                self._previous_view = camera.goal
            camera.frame(
                box, size[0] / max(size[1], 1.0), margin=_FRAMING_MARGIN, at_once=self.editor.less_motion()
            )
            self._own_view = camera.goal
        self._framed_limb, self._framed_for_s = box, 0.0

    def _go_back(self) -> None:
        """Restores the previous view, unless the artist has moved the view."""
        if self._previous_view is not None and not self._view_was_turned:
            *target, azimuth, elevation, distance = self._previous_view
            self.editor.camera.go(target, azimuth, elevation, distance)
        self._previous_view = self._framed_limb = None


def find_pending_limb_box(scene: Scene, character_id: str | None = None) -> Box | None:
    """Returns the bounding box of the limb that the next possession would attach.

    Returns None without such a limb, or if it is most of a character.

    Args:
        character_id: id of the character; None for the first one with a part about to be attached.
    """
    for actor in scene.actors:
        points = _find_limb(scene, actor) if character_id in (None, actor.character.id) else None
        box, whole = find_bounds([points]) if points is not None else None, find_bounds([actor.extent])
        if (
            box is not None
            and whole is not None
            and _measure_diagonal(box) < _MAX_PART_FRACTION * _measure_diagonal(whole)
        ):
            return box
    return None


def _find_limb(scene: Scene, actor: SceneCharacter) -> Float | None:
    """Returns the bones of the shown match, or the previewed nodes, (N, 3) in metres, or None without a match
    and a preview.
    """
    board, cues = scene.boards.get(actor.character.id), actor.cues
    if board is not None and board.state == "choosing" and 0 <= board.shown < len(board.rows):
        lines = [line for line in board.rows[board.shown].lines if len(line)]
        return np.concatenate(lines) if lines else None
    if cues is None or cues.attached_mask.all():
        return None
    nodes = cues.nodes[~cues.attached_mask]
    # Check the node numbers, because an edge may send invalid numbers.
    is_valid = nodes < len(actor.pose.positions)
    return np.asarray(actor.pose.positions[nodes[is_valid]], np.float64)


def _measure_diagonal(box: Box) -> float:
    """Returns the length of the box's diagonal in metres."""
    return float(np.linalg.norm(box[1] - box[0]))


def _has_moved(box: Box, before: Box) -> bool:
    """Returns True if a limb has moved, or is a different limb."""
    min_distance = _MIN_LIMB_MOVEMENT * max(_measure_diagonal(box), _measure_diagonal(before))
    return max(float(np.abs(box[k] - before[k]).max()) for k in (0, 1)) > min_distance
