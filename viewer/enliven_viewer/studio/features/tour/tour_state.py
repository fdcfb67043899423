"""The tour's interface to the studio: the chair, its performer, its motion, and counts of cuts and merges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from enliven.arrays import Float, Float32
from enliven.document import GraphCharacter
from enliven.overdub.possessed_overdub import has_motion
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.workspace_tabs import has_tools
from enliven_viewer.studio.features.perform.session import PerformSession


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

    workspace: App

    @property
    def perform(self) -> PerformSession:
        """Returns the session that is connected to a stage."""
        return self.workspace.state(PerformSession)

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
        return has_tools(self.workspace.tabs.active)

    @property
    def has_stage(self) -> bool:
        """Returns True if a stage has been requested."""
        return self.perform.live is not None

    @property
    def has_dancer(self) -> bool:
        """Returns True if a dancer is in view, and the chair is on the dancer's stage."""
        perform, chair = self.perform, self.chair
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
        return self.perform.recording.phase != "idle"

    @property
    def recorded_s(self) -> float:
        """Returns the length of the running recording in seconds, or 0 if no recording is running."""
        recording = self.perform.recording
        return recording.seconds if recording.phase == "recording" else 0.0

    @property
    def is_saved(self) -> bool:
        """Returns True if the project has a file without unsaved changes."""
        return self.workspace.is_saved

    @property
    def extent(self) -> Float | Float32 | None:
        """Returns points (N, 3) in metres on the shown chair, which is live or played back, or None without a
        chair.
        """
        chair, perform = self.chair, self.perform
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
        return [holder.character for holder in self.perform.holders if holder.character in graphs]


def _measure_size(shape: GraphCharacter) -> int:
    return len(shape.mesh.vertices)
