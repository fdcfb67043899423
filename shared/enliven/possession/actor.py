"""What every actor does: who holds a character, who would next, and its pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from enliven.arrays import Float
from enliven.deformation.constraints import ObservedPoints
from enliven.document import Character, Pose
from enliven.errors import InputError
from enliven.person import Body, parts_named
from enliven.possession.highlights import Cues, State

Mode = Literal["alone", "join", "extend"]
"""What happens to earlier holds when a performer takes hold: "alone" ends all of them, "join" keeps those of
other performers, "extend" keeps the performer's own too."""


class Actor:
    """A character that performers take hold of, drive and let go, whatever moves its mesh."""

    character: Character
    """The mesh with the pivots that move it."""
    holds: Any
    """The holds on it, the oldest first; ``body`` of each is the performer's id."""
    busy: frozenset[int] = frozenset()
    """The ids of the performers who hold other characters: they are not offered this one."""
    aside: float = 0.0
    """Metres towards +X by which it waits away from its usual place, where other characters wait."""
    size: float = 1.0
    """Metres of the mesh as modelled for one of its rest space."""
    growth: float = 1.0
    """How many times its own size it is shown at."""
    exaggeration: float | None = None
    """How far soft parts swing past the motion, where that was asked for; None: as its settings say."""
    settings: Any
    """How it meets and follows its performers: a dataclass."""
    _candidate: tuple[int | None, str] = (None, "all")

    @property
    def uses_surface(self) -> bool:
        """Whether it follows what the sensor sees of its performers' surfaces, not their skeletons alone."""
        return False

    @property
    def state(self) -> State:
        """Whether a performer holds it."""
        return "possessed" if self.holds else "free"

    @property
    def place(self) -> tuple[float, ...]:
        """Where the mesh stands: scale, radians about +Y, x, y, z in metres; empty where it has none."""
        return ()

    @property
    def candidate(self) -> tuple[int | None, str]:
        """The id of the performer who takes hold next, None for the first in view, and the parts."""
        return self._candidate

    def perform(
        self, bodies: list[Body], time_ns: int, seen: Mapping[int, ObservedPoints] | None = None
    ) -> Pose:
        """Returns the pose at a moment; performers out of view keep their last pose.

        Args:
            bodies: all performers in view, world frame.
            time_ns: nanoseconds, the sensor's clock.
            seen: by body id, the part of the performer's surface that the sensor sees.
        """
        raise NotImplementedError

    def possess(self, body: Body, parts: str = "all", mode: Mode = "alone") -> None:
        """Lets a performer take hold with parts of the body.

        Raises:
            InputError: for an unknown part, or where nothing can be reached; the actor stays as it was.
        """
        raise NotImplementedError

    def release(self, body: int | None = None) -> None:
        """Ends the hold of one performer, or of all where ``body`` is None; what is free eases back to rest.

        Raises:
            InputError: where that performer holds nothing of it.
        """
        raise NotImplementedError

    def resize(self, growth: float, about: Float | None = None, *, fade: bool = False) -> None:
        """Shows it at so many times its own size from now on; who holds it holds it as before.

        Args:
            about: (3,) metres, the place on the floor that stays; None: where it stands.
            fade: whether it eases over to it.

        Raises:
            InputError: where its size cannot change.
        """
        mend = "Scale it in the project."
        raise InputError("it is as large as it was made", where=f"sizing {self.character.id!r}", mend=mend)

    def exaggerate(self, exaggeration: float | None) -> None:
        """Lets soft parts swing so far past the motion from now on; None: as its settings say.

        Raises:
            InputError: where nothing of it can swing.
        """
        where = f"exaggerating {self.character.id!r}"
        raise InputError("no part of it can swing", where=where, mend="Choose a mesh that performers hold.")

    def preview(self, body: int | None = None, parts: str = "all") -> None:
        """Makes the cues show what this performer (None: the next one) would hold with these parts.

        Raises:
            InputError: for an unknown part.
        """
        parts_named(parts)
        self._candidate = (body, parts)

    def next_performer(self, bodies: list[Body]) -> Body | None:
        """Returns the first of the bodies that neither holds it nor is busy with another character."""
        return next(iter(self._idle(bodies)), None)

    def cues(self, bodies: list[Body]) -> Cues:
        """Returns what is held, and what the next performer would hold."""
        raise NotImplementedError

    def warm_up(self) -> None:
        """Runs everything once, so that no frame waits for a compiler."""
        raise NotImplementedError

    def _idle(self, bodies: Sequence[Body]) -> list[Body]:
        """Returns the bodies that neither hold it nor are busy with another character."""
        holders = {hold.body for hold in self.holds}
        return [body for body in bodies if body.id not in holders and body.id not in self.busy]

    def _need_holder(self, body: int | None, verb: tuple[str, str]) -> None:
        """Raises InputError where a performer (None: any) does not hold it.

        Args:
            verb: what a holder does, such as ("drive", "driven").
        """
        if body is not None and all(hold.body != body for hold in self.holds):
            who = ", ".join(str(hold.body) for hold in self.holds) or "nobody"
            what, mend = f"performer {body} does not {verb[0]} it", f"It is {verb[1]} by: {who}."
            raise InputError(what, where=f"releasing {self.character.id!r}", mend=mend)
