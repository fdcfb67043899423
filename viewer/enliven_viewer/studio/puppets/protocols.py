"""Protocols between the studio's puppets and the project's editor."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from enliven.arrays import Float
from enliven.document import ExampleCharacter, KeyPose, Project, RigBase
from enliven.examples.puppet_motion import PuppetState
from enliven_viewer.studio.puppets.motion_solver import MotionSolver
from enliven_viewer.studio.toasts import Toasts
from enliven_viewer.studio.viewport.selection import Selection

R = TypeVar("R", bound=RigBase)


class EditorProtocol(Protocol):
    """An editor: the project with its history, the current time, and the selection."""

    time: float
    playing: bool
    scrubbing: bool
    selection: Selection
    toasts: Toasts
    motion_solver: MotionSolver

    @property
    def project(self) -> Project:
        """Returns the shown project, including a draft."""

    def edit(self, name: str, change: Callable[[Project], Project]) -> bool:
        """Applies an edit and adds it to the history. Returns False if it failed."""

    def select(self, **changes: object) -> None:
        """Changes parts of the selection."""

    def select_only(self, character: str | None, handle: int | None = None) -> None:
        """Selects a character, and optionally one of its handles."""

    def find_selected(self, rig: type[R], /) -> R | None:
        """Returns the selected character if it has this type of rig."""


class PoseEditState(Protocol):
    """The edited key pose, or the dragged control point, as far as the stage must show it."""

    silhouette: bool
    start_state: PuppetState | None

    @property
    def puppet(self) -> ExampleCharacter | None:
        """Returns the selected puppet."""

    @property
    def number(self) -> int | None:
        """Returns the number of the key pose, or None while the puppet plays."""

    @property
    def previous(self) -> KeyPose | None:
        """Returns the key pose to show for comparison."""

    @property
    def places(self) -> Float | None:
        """Returns the control points (P, 3) in metres of the mesh's frame, or None while the puppet plays."""

    @property
    def is_dragging(self) -> bool:
        """Returns True if a control point is being dragged."""
