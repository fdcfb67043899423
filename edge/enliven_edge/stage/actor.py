"""The protocol that every character on the stage implements, whatever moves its mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeGuard

from enliven.deformation.constraints import ObservedPoints
from enliven.document import Character, Pose
from enliven.matching import Board, ScreenView
from enliven.person import Body
from enliven.possession import Cues, Mode, State


class Hold(Protocol):
    """A performer's hold of a character."""

    @property
    def body(self) -> int:
        """The performer's id."""


class Actor(Protocol):
    """A character that performers take hold of, drive and let go."""

    busy: frozenset[int]
    """The ids of the performers who hold other characters: they are not offered this one."""
    aside: float
    """Metres towards +X by which it waits away from its usual place, where other characters wait."""

    @property
    def character(self) -> Character:
        """The mesh with the pivots that move it."""

    @property
    def holds(self) -> Sequence[Hold]:
        """The holds on it, the oldest first."""

    @property
    def settings(self) -> Any:
        """How it meets and follows its performers: a dataclass."""

    @property
    def place(self) -> tuple[float, ...]:
        """Where the mesh stands: scale, radians about +Y, x, y, z in metres; empty where it has none."""

    @property
    def size(self) -> float:
        """Metres of the mesh as modelled for one of its rest space."""

    @property
    def uses_surface(self) -> bool:
        """Whether it follows what the sensor sees of its performers' surfaces."""

    @property
    def state(self) -> State:
        """Whether a performer holds it."""

    @property
    def candidate(self) -> tuple[int | None, str]:
        """The id of the performer who takes hold next, None for the first in view, and the parts."""

    def perform(
        self, bodies: list[Body], time_ns: int, seen: Mapping[int, ObservedPoints] | None = None
    ) -> Pose:
        """Returns the pose at a moment.

        Args:
            bodies: all performers in view, world frame.
            time_ns: nanoseconds, the sensor's clock.
            seen: by body id, the part of the performer's surface that the sensor sees.
        """

    def possess(self, body: Body, parts: str = "all", mode: Mode = "alone") -> None:
        """Lets a performer take hold with parts of the body.

        Raises:
            InputError: for an unknown part, or where nothing can be reached; the actor stays as it was.
        """

    def release(self, body: int | None = None) -> None:
        """Ends the hold of one performer, or of all where ``body`` is None."""

    def preview(self, body: int | None = None, parts: str = "all") -> None:
        """Makes the cues show what this performer (None: the next one) would hold with these parts."""

    def next_performer(self, bodies: list[Body]) -> Body | None:
        """The first of the bodies that neither holds the character nor is busy with another."""

    def cues(self, bodies: list[Body]) -> Cues:
        """Returns what is held, and what the next performer would hold."""

    def warm_up(self) -> None:
        """Compiles every kernel that its performances need."""


class ChosenActor(Actor, Protocol):
    """An actor that has performers choose a part by posing before they drive them."""

    view: ScreenView
    """The direction from which the viewer sees it: poses are matched as they look on the screen."""

    def browse(self, step: int) -> None:
        """Shows another match; step 0 follows the pose again."""

    def board(self) -> Board:
        """Returns the matches to choose from."""


def is_chosen(actor: Actor) -> TypeGuard[ChosenActor]:
    """Returns whether performers choose the parts of this actor that they move."""
    return hasattr(actor, "board")
