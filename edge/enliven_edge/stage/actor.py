"""What a character on the stage does, whatever moves its mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, Protocol, TypeGuard

from enliven.deformation.constraints import ObservedPoints
from enliven.document import Character, Pose
from enliven.matching import Board, ScreenView
from enliven.person import Body
from enliven_edge.stage.highlights import Cues, State

Mode = Literal["alone", "join", "extend"]
"""Who else holds after a performer took hold: nobody; the others too; the same performer, with more limbs."""


class Hold(Protocol):
    """A performer's hold of a character."""

    @property
    def body(self) -> int:
        """The performer's id."""


class Actor(Protocol):
    """A character that performers take hold of, drive and let go."""

    @property
    def character(self) -> Character:
        """The mesh with the pivots that move it."""

    @property
    def holds(self) -> Sequence[Hold]:
        """The performers who hold it, the first first."""

    @property
    def uses_surface(self) -> bool:
        """Whether it follows what the sensor sees of its performers' surfaces."""

    @property
    def state(self) -> State:
        """Whether a performer holds it."""

    @property
    def candidate(self) -> tuple[int | None, str]:
        """The performer who takes hold next, None for the first in view, and with what parts."""

    def perform(
        self, bodies: list[Body], time_ns: int, seen: Mapping[int, ObservedPoints] | None = None
    ) -> Pose:
        """The pose at a moment.

        Args:
            bodies: everybody in view, world frame.
            time_ns: the sensor's clock.
            seen: by body, the surface that the sensor sees of it.
        """

    def possess(self, body: Body, parts: str = "all", mode: Mode = "alone") -> None:
        """A performer takes hold with parts of the body.

        Raises:
            InputError: for an unknown part, or where nothing can be reached; the actor stays as it was.
        """

    def release(self, body: int | None = None) -> None:
        """A performer, or everybody, lets go."""

    def preview(self, body: int | None = None, parts: str = "all") -> None:
        """From now on the cues show what this performer (None: the next one) would hold with these parts."""

    def next_performer(self, bodies: list[Body]) -> Body | None:
        """The first of the bodies that does not hold the character."""

    def cues(self, bodies: list[Body]) -> Cues:
        """What is held, and what would be."""

    def warm_up(self) -> None:
        """Compiles every kernel that its performances need."""


class ChosenActor(Actor, Protocol):
    """An actor of which performers choose a part by posing before they drive it."""

    view: ScreenView
    """From where it is seen: what a pose means is decided on the screen."""

    def browse(self, step: int) -> None:
        """Shows another match; step 0 follows the pose again."""

    def board(self) -> Board:
        """What there is to choose from."""


def is_chosen(actor: Actor) -> TypeGuard[ChosenActor]:
    """Whether performers choose the parts of an actor that they move."""
    return hasattr(actor, "board")
