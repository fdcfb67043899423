"""The editor without a window: the project with its history, time, camera and selection."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from enliven.document import FREE, History, Project, RigBase, compute_closing_time
from enliven.errors import EnlivenError
from enliven.modeling.edits import refuse_locked
from enliven_viewer.language import later, tr
from enliven_viewer.playback.document import find_bounds
from enliven_viewer.render.camera import Box, OrbitCamera
from enliven_viewer.render.camera_moves import CameraMoves
from enliven_viewer.render.renderer import EMPTY_BOX
from enliven_viewer.studio.editor.background import BackgroundTask
from enliven_viewer.studio.editor.framing import find_visible_points
from enliven_viewer.studio.editor.rig_editor import RigEditors
from enliven_viewer.studio.editor.snapping import Snapping
from enliven_viewer.studio.editor.studio_stage import StudioStage
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.toasts import Toasts
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.studio.viewport.selection import Selection
from enliven_viewer.studio.viewport.stage_character import StageCharacter

Edit = Callable[[Project], Project]
R = TypeVar("R", bound=RigBase)
SHORTEST_RANGE_S = 0.1
"""Minimum length of the marked range in seconds. A shorter range is probably unintended."""
_FRAMING_MARGIN = 1.25
"""Framing margin: size of the view relative to the shapes, which leaves room to drag their ends."""


class Editor:
    """The project with its history, the time, the camera and the selection.

    An edit is a function Project -> Project. :meth:`edit` applies it and stores the result in the history.
    During a drag, :attr:`draft` is shown. It is stored only at the end of the drag.
    """

    def __init__(self, settings: StudioSettings | None = None, project: Project | None = None) -> None:
        self.settings = settings or StudioSettings()
        self.history = History(project or Project())
        self.draft: Project | None = None
        self.camera = OrbitCamera(self.settings.render.opening)
        self.camera_moves, self.look = CameraMoves(), self.settings.render.look
        self.size: tuple[float, float] = (float(self.settings.width), float(self.settings.height))
        self.selection = Selection()
        self.snapping = Snapping()
        self.toasts = Toasts(self.settings.toast)
        self.time, self.playing, self.loop, self.speed = 0.0, False, True, 1.0
        self.scrubbing = False
        self.show_bones, self.show_meshes = True, True
        self.is_auto_key = False  # Auto-key mode: posing a bone sets a key at the playhead.
        self.recorded_until_s = 0.0  # End time in seconds of the running recording.
        # Times in seconds at which recordings begin and end (punch-in and punch-out).
        self.marked_range: tuple[float, float] | None = None
        self.live_box: Box | None = None  # Bounding box of the live characters in metres.
        self.less_motion: Callable[[], bool] = lambda: False
        self.rig_editors = RigEditors()  # Features add the editors of some rigs.
        self.background = BackgroundTask(self.toasts, tr("Other work is still running"))
        self._stage = StudioStage(self, self.rig_editors)

    @property
    def project(self) -> Project:
        """Returns the shown project: the draft during a drag, otherwise the current state of the history."""
        return self.draft if self.draft is not None else self.history.project

    @property
    def length(self) -> float:
        """Returns the duration of the project in seconds."""
        return max(measure_project_length(self.project, self.settings.shortest), self.recorded_until_s)

    @property
    def lens(self) -> Lens:
        """Returns the camera and the viewport's size."""
        return Lens(self.camera.view(self.size[0] / max(self.size[1], 1.0)), self.size)

    @property
    def stage_characters(self) -> tuple[StageCharacter, ...]:
        """Returns every character in its current pose."""
        return self._stage.characters

    @property
    def editable_characters(self) -> tuple[StageCharacter, ...]:
        """Returns the characters with handles that every tool can edit."""
        return tuple(
            character
            for character in self.pickable_characters
            if len(character.handles) and not character.has_own_tool
        )

    @property
    def visible_characters(self) -> tuple[StageCharacter, ...]:
        """Returns the visible characters."""
        handling = self.project.handling
        return tuple(
            character for character in self.stage_characters if not handling.get(character.id, FREE).hidden
        )

    @property
    def pickable_characters(self) -> tuple[StageCharacter, ...]:
        """Returns the characters that can be picked: visible and not locked."""
        handling = self.project.handling
        return tuple(
            character for character in self.visible_characters if not handling.get(character.id, FREE).locked
        )

    def stage_character(self, character_id: str) -> StageCharacter:
        """Returns one character in its current pose.

        Raises:
            InputError: if no character has the id.
        """
        return self._stage.find(character_id)

    def find_selected(self, rig: type[R] = RigBase) -> R | None:  # type: ignore[assignment]
        """Returns the selected character if it has this type of rig.

        Returns None if no character is selected, or one of another type.
        """
        character = self.project.characters.get(self.selection.character or "")
        return character if isinstance(character, rig) else None

    def open_project(self, project: Project) -> None:
        """Opens another project, with an empty history."""
        self.history, self.draft = History(project), None
        for rig_editor in self.rig_editors.values():
            rig_editor.accept()
        self.selection, self.time, self.playing, self.marked_range = Selection(), 0.0, False, None
        self.frame_all()

    @property
    def selected_characters(self) -> tuple[RigBase, ...]:
        """Returns every selected character, in the project's order."""
        return tuple(
            character
            for character in self.project.characters.values()
            if character.id in self.selection.characters
        )

    def edit(self, name: str, change: Edit, *, over_locks: bool = False) -> bool:
        """Applies an edit and adds it to the history. If it fails, shows the reason and changes nothing.

        Args:
            over_locks: if True, locked characters may change too. Used for results that must not be lost.
        """
        self.draft = None
        after = self._try_edit(change, over_locks)
        if after is None:
            return False
        if after is not self.history.project:
            self.history.record_edit(name, after)
        self._clean_selection()
        return True

    def preview_edit(self, change: Edit) -> None:
        """Previews an edit during a drag, without adding it to the history."""
        self.draft = self._try_edit(change)

    def _try_edit(self, change: Edit, over_locks: bool = False) -> Project | None:
        """Returns the project after an edit. If the edit fails, shows a message and returns None. Shows
        internal errors instead of raising them, so that they do not close the window.
        """
        try:
            old_project = self.history.project
            after = change(old_project)
            if not over_locks:
                refuse_locked(old_project, after)
            return after
        except Exception as error:
            if not isinstance(error, EnlivenError) and os.environ.get("ENLIVEN_DEBUG"):
                raise
            self.toasts.show_any_error(
                error, tr("Nothing was changed. Save your work, and report this error.")
            )
        return None

    def undo(self) -> None:
        """Undoes the last edit."""
        self._step_history(
            later("Undone: {0}"),
            later("Nothing is left to undo"),
            self.history.undo_name,
            self.history.undo,
        )

    def redo(self) -> None:
        """Redoes the last undone edit."""
        self._step_history(
            later("Redone: {0}"),
            later("Nothing is left to redo"),
            self.history.redo_name,
            self.history.redo,
        )

    def go_to(self, step: int) -> None:
        """Shows the project after a step of the history. Step 0 is its state when it was opened."""
        self.draft = None
        self.history.go_to_step(step)
        self._clean_selection()

    def select(self, **changes: object) -> None:
        """Changes parts of the selection. Another character clears handle, chain and layer."""
        self.selection = self.selection.with_changes(**changes)

    def select_only(self, character: str | None, handle: int | None = None) -> None:
        """Selects only this character, and optionally one of its handles."""
        self.selection = Selection(character, handle)

    def choose_all(self, *characters: str) -> None:
        """Selects these characters. The last one is active."""
        self.selection = Selection.from_ids(*characters)

    def toggle_selected(self, character: str) -> None:
        """Adds a character to the selection, or removes it."""
        chosen = self.selection.characters
        rest = tuple(other for other in chosen if other != character)
        self.choose_all(*(rest if character in chosen else (*chosen, character)))

    def advance(self, seconds: float) -> None:
        """Advances the playhead, camera and messages by a time step."""
        self.camera_moves.advance(self.camera, self._find_subject_box(), seconds)
        self.camera.advance(math.inf if self.less_motion() else seconds)
        self.toasts.advance(seconds)
        for rig_editor in self.rig_editors.values():
            rig_editor.advance()
        self.background.poll()
        if self.playing and self.draft is None:
            self._advance_playhead(seconds * self.speed)

    def _advance_playhead(self, seconds: float) -> None:
        """Advances the playhead. Inside the marked range, it loops from the out point to the in point. A
        playhead beyond the out point continues to the end of the project.
        """
        first, last = 0.0, self.length
        if (
            self.marked_range is not None
            and self.recorded_until_s <= 0.0
            and self.time <= min(self.marked_range[1], self.length)
        ):
            first, last = self.marked_range[0], min(self.marked_range[1], self.length)
        self.time += seconds
        if self.time > last:
            wraps = self.loop and last > first
            self.time = first + (self.time - first) % (last - first) if wraps else last
            self.playing = self.playing and self.loop

    def set_loop_point(self, end: int) -> None:
        """Sets the in point (0) or the out point (1) to the playhead."""
        first, last = self.marked_range or (0.0, self.length)
        marked = (self.time, last) if end == 0 else (first, self.time)
        # If the marked range would become too short, move its other end to the start or the end of the
        # project.
        if marked[1] - marked[0] <= SHORTEST_RANGE_S:
            marked = (self.time, self.length) if end == 0 else (0.0, self.time)
        self.marked_range = marked if marked[1] - marked[0] > SHORTEST_RANGE_S else None

    def scrub(self, time: float) -> None:
        """Stops playback and moves the playhead to a time."""
        self.playing = False
        self.time = min(max(time, 0.0), self.length)

    def finish_scrubbing(self) -> None:
        """Ends scrubbing: settles surfaces that were only solved coarsely meanwhile."""
        if self.scrubbing:
            self.scrubbing = False
            for rig_editor in self.rig_editors.values():
                rig_editor.settle_surfaces()

    def frame_all(self, *, at_once: bool = False, reset: bool = True) -> None:
        """Moves the camera so that all characters are visible."""
        self.frame_box(self.measure_bounds(), at_once=at_once, reset=reset)

    def frame_box(self, box: Box | None, *, at_once: bool = False, reset: bool = True) -> None:
        """Moves the camera so that a box is visible. Without a box, shows the empty stage."""
        aspect = self.size[0] / max(self.size[1], 1.0)
        self.camera.frame(box or EMPTY_BOX, aspect, at_once=at_once, reset=reset, margin=_FRAMING_MARGIN)

    def _find_subject_box(self) -> Box | None:
        """Returns the bounding box of the camera's subject: the selected characters, or all.

        Returns None if following is off.
        """
        if not self.camera_moves.follow:
            return None
        visible = self.visible_characters
        chosen = [character for character in visible if character.id in self.selection.characters]
        return find_bounds([character.extent for character in chosen or visible])

    def measure_bounds(self) -> Box | None:
        """Returns the bounding box of all visible and live characters, or None if there are none."""
        points = [
            find_visible_points(character.handles, character.vertices)
            for character in self.visible_characters
        ]
        bounds = find_bounds([*points, *(() if self.live_box is None else (np.stack(self.live_box),))])
        if bounds is None:
            return None
        return bounds[0] - 0.05, bounds[1] + 0.05

    def _step_history(self, pattern: str, none: str, name: str | None, step: Callable[[], Project]) -> None:
        self.draft = None
        if name is None:
            self.toasts.show_message(tr(none))
            return
        step()
        self._clean_selection()
        self.toasts.show_message(tr(pattern, tr(name)))

    def _clean_selection(self) -> None:
        """Removes items from the selection that the project no longer contains."""
        self.selection = self.selection.restricted_to(self.project)
        self.time = float(np.clip(self.time, 0.0, self.length))


def measure_project_length(project: Project, shortest: float) -> float:
    """Returns the duration in seconds in which each layer and sound plays once, but at least ``shortest``.
    With looping layers it is slightly longer, so that all loops restart together.
    """
    layers = [layer for character in project.characters.values() for layer in character.playing]
    sounds = [sound.end for sound in project.sounds.values()]
    length = max([shortest, *(layer.end(project.length_of(layer)) for layer in layers), *sounds])
    return compute_closing_time(
        [layer.compute_loop_duration(project.length_of(layer)) for layer in layers if layer.loop], length
    )
