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
"""Effect of a new attachment on earlier holds. "alone" ends all of them, "join" keeps the holds of other
performers, and "extend" also keeps the performer's own holds."""


class Actor:
    """A character that performers attach to, drive and release, independent of how its mesh is moved."""

    character: Character
    """The mesh with the pivots that move it."""
    holds: Any
    """The holds (attached performers) on the character, oldest first. ``body`` of each hold is the
    performer's id."""
    busy: frozenset[int] = frozenset()
    """The ids of performers that hold other characters. They cannot attach to this character."""
    aside: float = 0.0
    """Offset towards +X, metres, from the usual waiting place. It is not 0 if other characters wait there."""
    size: float = 1.0
    """Metres of the mesh as modelled per metre of its rest space."""
    growth: float = 1.0
    """Display scale relative to the character's own size."""
    exaggeration: float | None = None
    """How far soft parts swing past the motion (a factor). None uses the value in the settings."""
    settings: Any
    """How the character approaches and follows its performers: a dataclass."""
    _candidate: tuple[int | None, str] = (None, "all")

    @property
    def uses_surface(self) -> bool:
        """True if the character follows the observed surface of its performers, and not only their
        skeletons."""
        return False

    @property
    def skeleton(self) -> Skeleton | None:
        """The joints at rest that the transforms of a rigged character belong to, or None."""
        return None

    @property
    def state(self) -> State:
        """The state: "possessed" if a performer holds the character, otherwise "free"."""
        return "possessed" if self.holds else "free"

    @property
    def place(self) -> tuple[float, ...]:
        """The placement of the mesh: scale, radians about +Y, and x, y, z in metres. Empty if the character
        has no placement.
        """
        return ()

    @property
    def candidate(self) -> tuple[int | None, str]:
        """The id of the performer that attaches next, and the body parts that attach. None as id means the
        first performer in view.
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
        """Ends the hold of one performer, or of all performers if ``body`` is None. Released parts ease back
        to rest.

        Raises:
            InputError: if that performer does not hold this character.
        """
        raise NotImplementedError

    def resize(self, growth: float, about: Float | None = None, *, fade: bool = False) -> None:
        """Sets the display scale relative to the character's own size. Existing holds are kept.

        Args:
            about: (3,) metres, the point on the floor that stays fixed; None uses the mesh's current place.
            fade: True eases the change.

        Raises:
            InputError: if the size of this character cannot change.
        """
        advice = "Scale it in the project."
        raise InputError(
            "its size cannot change on the stage", where=f"sizing {self.character.id!r}", remedy=advice
        )

    def exaggerate(self, exaggeration: float | None) -> None:
        """Sets how far soft parts swing past the motion. None uses the value in the settings.

        Raises:
            InputError: if no part of the character can swing.
        """
        where = f"exaggerating {self.character.id!r}"
        raise InputError("no part of it can swing", where=where, remedy="Choose a mesh that performers hold.")

    def preview(self, body: int | None = None, parts: str = "all") -> None:
        """Selects the performer and the body parts that :meth:`cues` previews. None as performer selects the
        next performer.

        Raises:
            InputError: for an unknown part.
        """
        parse_parts(parts)
        self._candidate = (body, parts)

    def next_performer(self, bodies: list[Body]) -> Body | None:
        """Returns the first body that neither holds this character nor is busy with another character."""
        return next(iter(self._free_bodies(bodies)), None)

    def cues(self, bodies: list[Body]) -> Cues:
        """Returns the nodes to highlight: those that are held, and those that the next performer would
        hold.
        """
        raise NotImplementedError

    def warm_up(self) -> None:
        """Runs all code paths once, so that no frame has to wait for compilation."""
        raise NotImplementedError

    def _free_bodies(self, bodies: Sequence[Body]) -> list[Body]:
        """Returns the bodies that neither hold this character nor are busy with another character."""
        holders = {hold.body for hold in self.holds}
        return [body for body in bodies if body.id not in holders and body.id not in self.busy]

    def _need_holder(self, body: int | None, verb: tuple[str, str]) -> None:
        """Raises InputError if a performer does not hold this character. Does nothing if ``body`` is None.

        Args:
            verb: verb and participle for the message, such as ("drive", "driven").
        """
        if body is not None and all(hold.body != body for hold in self.holds):
            holders = ", ".join(str(hold.body) for hold in self.holds) or "nobody"
            problem, advice = f"performer {body} does not {verb[0]} it", f"It is {verb[1]} by: {holders}."
            raise InputError(problem, where=f"releasing {self.character.id!r}", remedy=advice)
