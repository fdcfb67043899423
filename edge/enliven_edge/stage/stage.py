"""The stage: the characters and the performers who step into them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from enliven.deformation.constraints import ObservedPoints
from enliven.document import Pose
from enliven.errors import InputError
from enliven.frames import Frame
from enliven.matching import Board, ScreenView
from enliven.person import Body
from enliven_edge.stage.actor import Actor, ChosenActor, Mode, is_chosen
from enliven_edge.stage.highlights import Cues
from enliven_edge.stage.tick import Tick

Surfaces = Mapping[int, ObservedPoints]
"""By body id, the part of a performer's surface that a depth sensor sees."""


class Stage:
    """Turns the bodies of a frame into one pose for each character."""

    def __init__(self, actors: Sequence[Actor]) -> None:
        self.actors: dict[str, Actor] = {actor.character.id: actor for actor in actors}
        self._bodies: list[Body] = []

    @property
    def uses_surface(self) -> bool:
        """Whether some character follows what the sensor sees of its performers' surfaces."""
        return any(actor.uses_surface for actor in self.actors.values())

    def perform(
        self, bodies: list[Body], time_ns: int, surfaces: Callable[[], Surfaces] | None = None
    ) -> list[Pose]:
        """Returns one pose for each character.

        Args:
            bodies: all performers in view, world frame.
            time_ns: nanoseconds, the sensor's clock.
            surfaces: returns, by body id, the part of the performer's surface that a depth sensor sees; it is
                only called where a character follows surfaces.
        """
        self._bodies = bodies
        seen = surfaces() if surfaces is not None and self.uses_surface else None
        return [actor.perform(bodies, time_ns, seen) for actor in self.actors.values()]

    def tick(self, frame: Frame, poses: list[Pose], read_ns: int = 0) -> Tick:
        """Returns the result of the frame that was performed last.

        Args:
            poses: as :meth:`perform` returned them.
            read_ns: wall clock when the frame was read.
        """
        return Tick(frame, self._bodies, poses, read_ns, self.cues(), self.boards(), self.holders)

    @property
    def occupied(self) -> bool:
        """Whether a performer is in view."""
        return bool(self._bodies)

    @property
    def holders(self) -> frozenset[int]:
        """The ids of the performers who hold a character."""
        return frozenset(hold.body for actor in self.actors.values() for hold in actor.holds)

    def cues(self) -> dict[str, Cues]:
        """Returns, by character id, the nodes that are held or would be."""
        return {name: actor.cues(self._bodies) for name, actor in self.actors.items()}

    def possess(
        self, character: str, body: int | None = None, parts: str = "all", mode: Mode = "alone"
    ) -> None:
        """Lets a performer take hold of a character now.

        Args:
            character: its id.
            body: the performer's id; None: the first in view, for "join" the first who does not hold it yet.
            parts: the parts that take hold, names of :data:`enliven.person.body.PARTS`.
            mode: what happens to earlier holds, see :data:`~enliven_edge.stage.actor.Mode`.

        Raises:
            InputError: where there is no such character or performer, or nothing is in reach.
        """
        actor = self._actor(character)
        present = [b for b in self._bodies if body is None or b.id == body]
        if not present:
            who = "nobody is in view" if body is None else f"performer {body} is not in view"
            raise InputError(
                who, where=f"possessing {character!r}", mend="Step in front of the sensor first."
            )
        joining = actor.next_performer(present) if mode == "join" else None
        actor.possess(joining or present[0], parts, mode)

    def idle(self, character: str) -> Body | None:
        """Returns the first performer in view who does not hold a character; None if there is none."""
        return self._actor(character).next_performer(self._bodies)

    def candidate(self, character: str, mode: Mode = "alone") -> tuple[int | None, str]:
        """Returns the id and the parts of the performer who takes hold where a request names none.

        The cues show the same. Mode "extend" means the first holder in view. The id is None if that performer
        is not in view.
        """
        actor = self._actor(character)
        body, parts = actor.candidate
        present = {one.id for one in self._bodies}
        if mode == "extend":
            body = next((hold.body for hold in actor.holds if hold.body in present), body)
        return (body if body in present else None), parts

    def preview(self, character: str, body: int | None = None, parts: str = "all") -> None:
        """Makes the cues show what this performer (None: the next one) would hold with these parts."""
        self._actor(character).preview(body, parts)

    def release(self, character: str, body: int | None = None) -> None:
        """Ends the hold of one performer, or of all; a free character eases back to rest where it stands."""
        self._actor(character).release(body)

    def set_view(self, view: ScreenView) -> None:
        """Sets the viewer's direction: rigged characters match poses as they look on its screen."""
        for actor in self._rigs():
            actor.view = view

    def browse(self, character: str, step: int) -> None:
        """Shows another match of a rigged character; step 0 follows the pose again.

        Raises:
            InputError: where there is no such character, or it is not rigged.
        """
        actor = self._actor(character)
        if not is_chosen(actor):
            mend = "Give the edge a rigged model and --drive skeleton."
            raise InputError("nothing is chosen from it", where=f"character {character!r}", mend=mend)
        actor.browse(step)

    def boards(self) -> list[Board]:
        """Returns the matches to choose from, for each rigged character."""
        return [actor.board() for actor in self._rigs()]

    def _rigs(self) -> list[ChosenActor]:
        return [actor for actor in self.actors.values() if is_chosen(actor)]

    def _actor(self, character: str) -> Actor:
        if character not in self.actors:
            known = ", ".join(self.actors) or "none"
            what = f"there is no character {character!r}"
            raise InputError(what, where="stage", mend=f"Known: {known}.")
        return self.actors[character]
