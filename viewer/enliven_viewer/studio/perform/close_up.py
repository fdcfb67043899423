"""The view goes to the limb that is about to be held, and back; a second one sees it from the side."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float
from enliven_viewer.playback import bounds_of
from enliven_viewer.render import Box, OrbitCamera, Scene, SceneCharacter
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.viewport import Lens

_ROOM = 1.7
"""How much larger than the limb the picture is: what it hangs on is seen too."""
_WHOLE = 0.75
"""Share of a character's size from which on what is held is no limb of it: the view stays."""
_DWELL = 0.7
"""Seconds for which the view stays at a limb at least, so that it does not leap between two alike."""
_MOVED = 0.35
"""Share of a limb's size by which it is elsewhere before the view follows it."""
_SAME = 1e-6
"""Metres and radians within which the view is where it was sent: else the artist turned it."""


class CloseUp:
    """Moves the editor's camera while a performer chooses what to take hold of.

    Attributes:
        on: whether the view goes there.
        box: around the limb, metres; None if none is about to be held.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.on = False
        self.box: Box | None = None
        self._before: tuple[float, ...] | None = None
        self._sent: tuple[float, ...] = ()
        self._framed: Box | None = None
        self._since = 0.0

    def toggle(self) -> None:
        """Lets the view go to the limb, or leave it."""
        self.on = not self.on

    def advance(self, seconds: float, scene: Scene | None, meant: str | None) -> None:
        """Goes to what is about to be held in a scene, of the character that is meant or else of any."""
        self._since += seconds
        found = None if scene is None or not self.on else about_to_be_held(scene, meant)
        if found is None and self.box is not None and self.on and scene is not None and self._since < _DWELL:
            return
        self.box = found
        if found is None:
            self._go_back()
        elif self._framed is None or (self._since > _DWELL and _elsewhere(found, self._framed)):
            self._go_to(found)

    def lens(self, width: float, height: float) -> Lens | None:
        """Returns the view from the side on the limb, for a picture of so many pixels; None without one."""
        if self.box is None:
            return None
        camera = OrbitCamera(self.editor.camera.field_of_view)
        azimuth, elevation = self.editor.camera.goal[3:5]
        camera.face(azimuth + math.pi / 2, elevation)
        camera.frame(self.box, width / height, at_once=True, room=_ROOM)
        return Lens(camera.view(width / height), (width, height))

    @property
    def _turned(self) -> bool:
        """Returns True if the artist moved the view since it was sent to the limb."""
        return not np.allclose(self.editor.camera.goal, self._sent, atol=_SAME)

    def _go_to(self, box: Box) -> None:
        """Frame a limb, unless the artist looks elsewhere meanwhile."""
        camera, size = self.editor.camera, self.editor.size
        if self._framed is not None and self._turned:
            self._before = None
        else:
            if self._framed is None:
                self._before = camera.goal
            camera.frame(box, size[0] / max(size[1], 1.0), room=_ROOM, at_once=self.editor.less_motion())
            self._sent = camera.goal
        self._framed, self._since = box, 0.0

    def _go_back(self) -> None:
        """Looks again as before, unless the artist turned the view."""
        if self._before is not None and not self._turned:
            *target, azimuth, elevation, distance = self._before
            self.editor.camera.go(target, azimuth, elevation, distance)
        self._before = self._framed = None


def about_to_be_held(scene: Scene, meant: str | None = None) -> Box | None:
    """Returns the box around the limb that the next hold would take; None for none, or for most of a
    character.

    Args:
        meant: the id of the character that is looked at; None: the first of which something would be held.
    """
    for actor in scene.actors:
        points = _limb(scene, actor) if meant in (None, actor.character.id) else None
        box, whole = bounds_of([points]) if points is not None else None, bounds_of([actor.extent])
        if box is not None and whole is not None and _size(box) < _WHOLE * _size(whole):
            return box
    return None


def _limb(scene: Scene, actor: SceneCharacter) -> Float | None:
    """Returns (N, 3) metres: the bones of the match that is shown, or the nodes that would be held; None
    without.
    """
    board, cues = scene.boards.get(actor.character.id), actor.cues
    if board is not None and board.state == "choosing" and 0 <= board.shown < len(board.rows):
        lines = [line for line in board.rows[board.shown].lines if len(line)]
        return np.concatenate(lines) if lines else None
    if cues is None or cues.firm.all():
        return None
    nodes = cues.nodes[~cues.firm]
    known = nodes < len(actor.pose.positions)  # an edge may name any node
    return np.asarray(actor.pose.positions[nodes[known]], np.float64)


def _size(box: Box) -> float:
    """Returns metres from corner to corner."""
    return float(np.linalg.norm(box[1] - box[0]))


def _elsewhere(box: Box, before: Box) -> bool:
    """Returns True if a limb has moved, or is another one."""
    least = _MOVED * max(_size(box), _size(before))
    return max(float(np.abs(box[k] - before[k]).max()) for k in (0, 1)) > least
