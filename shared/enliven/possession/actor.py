"""The interface of an actor: a character on the stage that performers can attach to and move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from enliven.arrays import Float
from enliven.deformation.constraints.observed import ObservedPoints
from enliven.document import Character, Pose, Skeleton
from enliven.errors import InputError
from enliven.person import Body, parse_parts
from enliven.possession.highlights import Cues, State

Mode = Literal["alone", "join", "extend"]
"""Effect of a new attachment on earlier attachments. "alone" detaches all performers first. "join" keeps
other performers attached. "extend" also keeps the earlier attachments of the same performer."""


class Actor:
    """A character that performers can attach to, drive and release. Subclasses define how its mesh is
    moved."""

    character: Character
    """The mesh with the pivots that move it."""
    holds: Any
    """The attached performers, the one attached longest first. ``body`` of each entry is the performer's
    id."""
    busy: frozenset[int] = frozenset()
    """The ids of performers who are attached to other characters. They cannot attach to this character."""
    aside: float = 0.0
    """Offset towards +X, metres, from the usual waiting position. It is above 0 if other characters wait
    there."""
    size: float = 1.0
    """Scale: metres of the mesh as modelled per metre of its rest space."""
    growth: float = 1.0
    """Display scale relative to the character's own size."""
    exaggeration: float | None = None
    """Factor on the overshoot of soft parts that swing. None uses the value in the settings."""
    settings: Any
    """A dataclass with the settings of the character's approach to its performers and of the motion
    transfer."""
    _candidate: tuple[int | None, str] = (None, "all")

    @property
    def uses_surface(self) -> bool:
        """True if the character also follows the performers' surface seen by depth sensors, and not only
        their skeletons."""
        return False

    @property
    def skeleton(self) -> Skeleton | None:
        """The skeleton at rest of a rigged character. The character's transforms move its joints. None for
        other characters."""
        return None

    @property
    def state(self) -> State:
        """The state: "possessed" if a performer is attached to the character, otherwise "free"."""
        return "possessed" if self.holds else "free"

    @property
    def place(self) -> tuple[float, ...]:
        """The placement of the mesh: scale, radians about +Y, and x, y, z in metres. Empty if the character
        has no placement.
        """
        return ()

    @property
    def candidate(self) -> tuple[int | None, str]:
        """The id of the performer who will attach next, and the name of the body parts that will attach. The
        id None means the first performer in view.
        """
        return self._candidate

    def perform(
        self, bodies: list[Body], time_ns: int, seen: Mapping[int, ObservedPoints] | None = None
    ) -> Pose:
        """Returns the pose of the character at a time. Performers out of view keep their last pose.

        Args:
            bodies: all performers in view, world frame.
            time_ns: nanoseconds, the sensor's clock.
            seen: for each body id, the visible part of the performer's surface.
        """
        raise NotImplementedError

    def possess(self, body: Body, parts: str = "all", mode: Mode = "alone") -> None:
        """Attaches some body parts of a performer to the character.

        Raises:
            InputError: if a part is unknown, or if nothing is within reach. The actor is then unchanged.
        """
        raise NotImplementedError

    def release(self, body: int | None = None) -> None:
        """Detaches one performer, or all performers if ``body`` is None. Released parts of the mesh ease back
        to rest.

        Raises:
            InputError: if that performer is not attached to this character.
        """
        raise NotImplementedError

    def resize(self, growth: float, about: Float | None = None, *, fade: bool = False) -> None:
        """Sets the display scale relative to the character's own size. Performers stay attached.

        Args:
            about: (3,) metres, the point on the floor that stays fixed; None uses the mesh's current place.
            fade: True eases the change.

        Raises:
            InputError: if the size of this character cannot change.
        """
        advice = "Scale the character in the project."
        raise InputError(
            "the size of this character cannot change on the stage",
            where=f"sizing {self.character.id!r}",
            remedy=advice,
        )

    def exaggerate(self, exaggeration: float | None) -> None:
        """Sets the factor on the overshoot of soft parts that swing. None uses the value in the settings.

        Raises:
            InputError: if no part of the character can swing.
        """
        where = f"exaggerating {self.character.id!r}"
        raise InputError(
            "no part of this character can swing freely, because performers cannot attach to the character",
            where=where,
            remedy="Choose a mesh that performers can possess.",
        )

    def preview(self, body: int | None = None, parts: str = "all") -> None:
        """Selects the performer (body id) and the body parts for the preview in :meth:`cues`. The id None
        selects the first free performer.

        Raises:
            InputError: for an unknown part.
        """
        parse_parts(parts)
        self._candidate = (body, parts)

    def next_performer(self, bodies: list[Body]) -> Body | None:
        """Returns the first body that is attached to no character, or None."""
        return next(iter(self._free_bodies(bodies)), None)

    def cues(self, bodies: list[Body]) -> Cues:
        """Returns the nodes to highlight: those that performers are attached to, and those that the next
        performer would attach to.
        """
        raise NotImplementedError

    def warm_up(self) -> None:
        """Runs all code paths once, so that no frame has to wait for compilation."""
        raise NotImplementedError

    def _free_bodies(self, bodies: Sequence[Body]) -> list[Body]:
        """Returns the bodies that are attached to no character."""
        holders = {hold.body for hold in self.holds}
        return [body for body in bodies if body.id not in holders and body.id not in self.busy]

    def _require_holder(self, body: int | None, verb: tuple[str, str]) -> None:
        """Raises InputError if a performer is not attached to this character. Does nothing if ``body`` is
        None.

        Args:
            verb: verb and participle for the message, such as ("drive", "driven").
        """
        if body is not None and all(hold.body != body for hold in self.holds):
            holders = ", ".join(str(hold.body) for hold in self.holds) or "nobody"
            problem, advice = (
                f"performer {body} does not {verb[0]} this character",
                f"The character is {verb[1]} by: {holders}.",
            )
            raise InputError(problem, where=f"releasing {self.character.id!r}", remedy=advice)
