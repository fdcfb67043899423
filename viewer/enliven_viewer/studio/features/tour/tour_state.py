"""The tour's interface to the studio: the chair, its performer, its motion, and counts of cuts and merges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from enliven.arrays import Float, Float32
from enliven.document import GraphCharacter
from enliven.overdub.possessed_overdub import has_motion
from enliven_viewer.studio.actions.table import ActionTable
from enliven_viewer.studio.app.contributions import Panel
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.tools.base import Tool
from enliven_viewer.studio.viewport.overlay import Point

_TOOL_WORKSPACES = ("Animate", "Model")
"""The workspaces with tools."""


class SavedFile(Protocol):
    """The file of the project."""

    @property
    def named(self) -> bool:
        """Returns True if the project has a file."""

    @property
    def dirty(self) -> bool:
        """Returns True if there is unsaved work."""


class TourInput(Protocol):
    """The input over the view: pointer, buttons and tools."""

    tool: Tool
    at: Point

    def activate_tool(self, name: str) -> None:
        """Makes another tool the active one."""

    def press(self, at: Point, button: int = 0, *, shift: bool = False) -> None:
        """Presses a button at a pixel of the view."""

    def move(self, at: Point, *, shift: bool = False) -> None:
        """Moves the pointer to a pixel of the view."""

    def release(self, at: Point, button: int = 0, *, shift: bool = False) -> None:
        """Releases the button."""

    @property
    def busy(self) -> bool:
        """Returns True if a button is held."""


class TourFileField(Protocol):
    """The interface to the file dialogue that the tour fills in."""

    folder: Path
    name: str

    def get_path(self) -> Path:
        """Returns the chosen path."""


class TourWorkspace(Protocol):
    """The interface to the workspace that the tour uses."""

    @property
    def editor(self) -> Editor:
        """Returns the editor."""

    @property
    def actions(self) -> ActionTable:
        """Returns every action."""

    @property
    def store(self) -> SavedFile:
        """Returns the file of the project."""

    @property
    def perform(self) -> PerformSession:
        """Returns the session that is connected to a stage."""

    @property
    def input(self) -> TourInput:
        """Returns the input over the view."""

    @property
    def panels(self) -> Sequence[Panel]:
        """Returns the panels that features have added."""

    @property
    def asking(self) -> str:
        """Returns the name of the open dialogue, or an empty text."""

    @property
    def browser(self) -> TourFileField | None:
        """Returns the contents of a file dialogue."""

    def run_and_report(self, command: Callable[[], object]) -> bool:
        """Calls a function. Shows an error as a message and returns False."""

    def finish_file_dialog(self, path: Path) -> None:
        """Chooses a file in the dialogue."""


@dataclass(frozen=True)
class TourCounts:
    """Counters for detecting what has happened since a step began."""

    chairs: int
    merges: int


@dataclass(frozen=True)
class TourState:
    """Answers the tour's questions about the state of the studio.

    Attributes:
        workspace: the workspace.
    """

    workspace: TourWorkspace

    @property
    def chairs(self) -> tuple[GraphCharacter, ...]:
        """Returns the characters that a dancer can possess, and the parts that were cut off."""
        return tuple(self.workspace.editor.project.graphs.values())

    @property
    def counts(self) -> TourCounts:
        """Returns the current counts."""
        merges = sum(name.startswith("merge") for name in self.workspace.editor.history.names)
        return TourCounts(len(self.chairs), merges)

    @property
    def chair(self) -> GraphCharacter | None:
        """Returns the chair of the tour: the possessed chair, otherwise the largest chair, or None without a
        chair.
        """
        held = self._find_held_characters()
        chairs = sorted(self.chairs, key=lambda shape: (shape.id in held, _measure_size(shape)))
        return chairs[-1] if chairs else None

    @property
    def piece(self) -> GraphCharacter | None:
        """Returns the smallest part that was cut off the chair, or None if there is none."""
        pieces = [chair for chair in self.chairs if chair is not self.chair]
        return min(pieces, key=_measure_size) if pieces else None

    @property
    def has_workshop(self) -> bool:
        """Returns True if the current workspace has tools."""
        return self.workspace.perform.active_workspace in _TOOL_WORKSPACES

    @property
    def has_stage(self) -> bool:
        """Returns True if a stage has been requested."""
        return self.workspace.perform.live is not None

    @property
    def has_dancer(self) -> bool:
        """Returns True if a dancer is in view, and the chair is on the dancer's stage."""
        perform, chair = self.workspace.perform, self.chair
        is_on_stage = chair is not None and chair.id in perform.stage_ids
        return is_on_stage and perform.connected and bool(perform.performers)

    @property
    def is_held(self) -> bool:
        """Returns True if a dancer possesses the chair."""
        return bool(self._find_held_characters())

    @property
    def dances(self) -> bool:
        """Returns True if the chair has its own motion."""
        chair = self.chair
        return chair is not None and has_motion(self.workspace.editor.project, chair)

    @property
    def records(self) -> bool:
        """Returns True if a recording is running or counting in."""
        return self.workspace.perform.recording.phase != "idle"

    @property
    def recorded_s(self) -> float:
        """Returns the length of the running recording in seconds, or 0 if no recording is running."""
        recording = self.workspace.perform.recording
        return recording.seconds if recording.phase == "recording" else 0.0

    @property
    def is_saved(self) -> bool:
        """Returns True if the project has a file without unsaved changes."""
        return self.workspace.store.named and not self.workspace.store.dirty

    @property
    def extent(self) -> Float | Float32 | None:
        """Returns points (N, 3) in metres on the shown chair, which is live or played back, or None without a
        chair.
        """
        chair, perform = self.chair, self.workspace.perform
        if chair is None:
            return None
        live = () if perform.scene is None else perform.scene.actors
        for actor in live if chair.id in perform.hidden else ():
            if actor.character.id == chair.id:
                return actor.extent
        return self.workspace.editor.stage_character(chair.id).extent

    def has_tool(self, name: str) -> bool:
        """Returns True if a tool is active."""
        return self.workspace.input.tool.name == name

    def _find_held_characters(self) -> Sequence[str]:
        graphs = self.workspace.editor.project.graphs
        return [holder.character for holder in self.workspace.perform.holders if holder.character in graphs]


def _measure_size(shape: GraphCharacter) -> int:
    return len(shape.mesh.vertices)
