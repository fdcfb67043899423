"""Protocols between the puppets of the studio and the editor that holds the project."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from enliven.arrays import Float
from enliven.document import KeyPose, Project, Puppet, RigBase
from enliven.examples import State
from enliven_viewer.studio.examples import Solving
from enliven_viewer.studio.toasts import Toasts
from enliven_viewer.studio.viewport import Selection

R = TypeVar("R", bound=RigBase)


class Editing(Protocol):
    """An editor: the project with its history, the time that is shown, and the selection."""

    time: float
    playing: bool
    scrubbing: bool
    selection: Selection
    toasts: Toasts
    solving: Solving

    @property
    def project(self) -> Project:
        """Returns the project as it is shown."""

    def edit(self, name: str, change: Callable[[Project], Project]) -> bool:
        """Does an edit and remember it; False if it cannot be done."""

    def select(self, **changes: object) -> None:
        """Changes parts of the selection."""

    def choose(self, character: str | None, handle: int | None = None) -> None:
        """Chooses a character, and perhaps a handle of it."""

    def chosen(self, rig: type[R], /) -> R | None:
        """Returns the chosen character, where it has that rig."""


class Posing(Protocol):
    """The key pose that is edited, or the control point that is dragged, as the stage shows it."""

    silhouette: bool
    start_state: State | None

    @property
    def puppet(self) -> Puppet | None:
        """Returns the chosen puppet."""

    @property
    def number(self) -> int | None:
        """Returns the number of the key pose; None while the puppet plays."""

    @property
    def previous(self) -> KeyPose | None:
        """Returns the key pose that it is compared with."""

    @property
    def places(self) -> Float | None:
        """Returns (P, 3) metres in the mesh's frame; None while the puppet plays."""

    @property
    def dragging(self) -> bool:
        """Returns True if a control point is dragged."""
