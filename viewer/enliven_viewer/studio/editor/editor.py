"""The editor without a window: the project with its past, time, camera and selection."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enliven.document import History, Project
from enliven.errors import EnlivenError
from enliven_viewer.playback import bounds_of
from enliven_viewer.render import EMPTY_BOX, Box, OrbitCamera
from enliven_viewer.studio.examples import Solving
from enliven_viewer.studio.puppets import PuppetEditor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.toasts import Toasts
from enliven_viewer.studio.viewport import (
    Lens,
    Players,
    PosedShape,
    Possessed,
    Selection,
    length_of,
    possessed_of,
    valid_selection,
)

log = logging.getLogger(__name__)
Edit = Callable[[Project], Project]
_ROOM = 1.25
"""Size of the picture over that of all shapes when they are framed: room to drag their ends."""


class Editor:
    """The project with its history, the time, the camera and the selection.

    An edit is a function Project -> Project; :meth:`edit` does it and remembers what was before. While
    something is dragged :attr:`draft` is what is shown, and nothing is remembered until it is dropped.
    """

    def __init__(self, settings: StudioSettings | None = None, project: Project | None = None) -> None:
        self.settings = settings or StudioSettings()
        self.history = History(project or Project())
        self.draft: Project | None = None
        self.camera = OrbitCamera(self.settings.render.opening)
        self.size: tuple[float, float] = (float(self.settings.width), float(self.settings.height))
        self.selection = Selection()
        self.toasts = Toasts(self.settings.toast)
        self.time, self.playing, self.loop, self.speed = 0.0, False, True, 1.0
        self.show_bones, self.show_meshes = True, True
        self.puppets = PuppetEditor(self)
        self.solving = Solving(self.toasts)
        self._players = Players()
        self._possessed: tuple[Project, float, tuple[Possessed, ...]] | None = None
        self._posed_shapes: tuple[Project, float, tuple[PosedShape, ...]] | None = None

    @property
    def project(self) -> Project:
        """The project that is shown: the draft during a drag, else the newest of the history."""
        return self.draft if self.draft is not None else self.history.project

    @property
    def length(self) -> float:
        """Seconds that the project plays."""
        return length_of(self.project, self.settings.shortest)

    @property
    def lens(self) -> Lens:
        """The camera and the viewport's size."""
        return Lens(self.camera.view(self.size[0] / max(self.size[1], 1.0)), self.size)

    @property
    def posed_shapes(self) -> tuple[PosedShape, ...]:
        """Every shape as it is shown now."""
        known = self._posed_shapes
        if known is None or known[0] is not self.project or known[1] != self.time:
            made = self._players.posed_shapes(self.project, self.time)
            self._posed_shapes = known = (self.project, self.time, made)
        return known[2]

    @property
    def possessed(self) -> tuple[Possessed, ...]:
        """Every possessed mesh as it is shown now."""
        known = self._possessed
        if known is None or known[0] is not self.project or known[1] != self.time:
            self._possessed = known = (self.project, self.time, possessed_of(self.project, self.time))
        return known[2]

    def posed(self, shape_id: str) -> PosedShape:
        """One shape as it is shown now.

        Raises:
            InputError: where there is no such shape.
        """
        self.project.shape(shape_id)
        return next(posed for posed in self.posed_shapes if posed.shape.id == shape_id)

    def begin(self, project: Project) -> None:
        """Another project, with no past."""
        self.history, self.draft = History(project), None
        self.puppets.accept()
        self.selection, self.time, self.playing = Selection(), 0.0, False
        self.frame_all()

    def edit(self, name: str, change: Edit) -> bool:
        """Do an edit and remember it; where it cannot be done, say why and change nothing."""
        self.draft = None
        after = self._tried(change)
        if after is None:
            return False
        if after is not self.history.project:
            self.history.do(name, after)
        self._mend_selection()
        return True

    def sketch(self, change: Edit) -> None:
        """Show what an edit would make, while something is dragged; nothing is remembered."""
        self.draft = self._tried(change)

    def _tried(self, change: Edit) -> Project | None:
        """The project after an edit; None, and a message, where it cannot be done.

        A fault of our own is told as well, not raised: an artist's window must not go down with it.
        """
        try:
            return change(self.history.project)
        except EnlivenError as error:
            self.toasts.complain(error)
        except Exception as error:
            if os.environ.get("ENLIVEN_DEBUG"):
                raise
            log.exception("an edit failed")
            what = f"a fault of enliven itself: {type(error).__name__}: {error}"
            self.toasts.complain(
                EnlivenError(what, mend="Nothing was changed. Save your work, and report it.")
            )
        return None

    def undo(self) -> None:
        """Undo the last edit."""
        self._step("Undone", self.history.undo_name, self.history.undo)

    def redo(self) -> None:
        """Redo the edit that was undone last."""
        self._step("Done again", self.history.redo_name, self.history.redo)

    def select(self, **changes: object) -> None:
        """Change parts of the selection; another shape forgets joint and chain."""
        if "shape" in changes and changes["shape"] != self.selection.shape:
            self.selection = Selection(layer=self.selection.layer)
        if changes.get("graph") is not None:
            self.selection = Selection()
        if changes.get("puppet", self.selection.puppet) != self.selection.puppet:
            self.selection = Selection()
        self.selection = replace(self.selection, **changes)  # type: ignore[arg-type]

    def choose(self, character_id: str) -> None:
        """Choose a character of any rig."""
        kind = self.project.characters[character_id].kind
        if kind == "points":
            self.puppets.choose(character_id)
        else:
            self.select(**{"shape" if kind == "bones" else "graph": character_id})

    def advance(self, seconds: float) -> None:
        """Let time pass: the playhead, the camera, the messages."""
        self.camera.advance(seconds)
        self.toasts.advance(seconds)
        self.puppets.advance()
        if self.playing and self.draft is None:
            self.time += seconds * self.speed
            if self.time > self.length:
                self.time = self.time % self.length if self.loop else self.length
                self.playing = self.playing and self.loop

    def scrub(self, time: float) -> None:
        """Show a time, and stay there."""
        self.playing = False
        self.time = min(max(time, 0.0), self.length)

    def frame_all(self, *, at_once: bool = False, reset: bool = True) -> None:
        """Bring every shape into the picture."""
        aspect = self.size[0] / max(self.size[1], 1.0)
        self.camera.frame(self.box() or EMPTY_BOX, aspect, at_once=at_once, reset=reset, room=_ROOM)

    def box(self) -> Box | None:
        """The box around all shapes, meshes and puppets now; None where there are none."""
        filled = [points for s in self.posed_shapes for points in (s.joints, s.surface())]
        filled += [mesh.vertices for mesh in self.possessed]
        bounds = bounds_of(filled + [puppet.vertices for puppet in self.puppets.standing])
        if bounds is None:
            return None
        return bounds[0] - 0.05, bounds[1] + 0.05

    def _step(self, word: str, name: str | None, step: Callable[[], Project]) -> None:
        self.draft = None
        if name is None:
            self.toasts.say(f"Nothing is left to be {word.lower()}")
            return
        step()
        self._mend_selection()
        self.toasts.say(f"{word}: {name}")

    def _mend_selection(self) -> None:
        """Remove from the selection what the project no longer has."""
        self.selection = valid_selection(self.selection, self.project)
        self.time = float(np.clip(self.time, 0.0, self.length))
