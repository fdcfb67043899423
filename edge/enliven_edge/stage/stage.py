"""The stage: the characters and the performers who possess them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from enliven.arrays import Float
from enliven.deformation.constraints.observed import ObservedPoints
from enliven.document import Character, Pose
from enliven.errors import EnlivenError, InputError
from enliven.frames import Frame
from enliven.matching.match_list import MatchList
from enliven.matching.views import ScreenView
from enliven.person import Body
from enliven.possession import Actor, Cues, Mode
from enliven_edge.stage.actor import ChosenActor
from enliven_edge.stage.choice import FLOOR, PendingPossession, order_performers, pair_nearest
from enliven_edge.stage.hold_log import HoldLog
from enliven_edge.stage.hold_memory import HoldMemory, HoldStarts
from enliven_edge.stage.stage_capacity import Peer, StageCapacity, StageSettings
from enliven_edge.stage.tick import Tick

Surfaces = Mapping[int, ObservedPoints]
"""The visible surface of each performer, by body id."""
_CHARACTER_GAP_M = 0.4
"""Gap in metres on the floor between two free characters next to each other. It keeps their arms from
touching."""


class Stage:
    """The characters of a performance. Computes the pose of each character from the bodies of a frame.

    A command need not name the performer or the character. In this case idle performers are preferred to
    performers who possess another character, free characters to possessed characters, and near characters to
    far characters. At equal distances, the first performer in view and the first character on the stage are
    preferred. A command that names both is carried out unchanged: a performer may possess several characters,
    and a character may have several performers.

    Attributes:
        places: limits the number of characters that viewers put on the stage.
    """

    def __init__(self, actors: Sequence[Actor] = (), settings: StageSettings | None = None) -> None:
        self.actors: dict[str, Actor] = {}
        self.places = StageCapacity(settings or StageSettings(), self.actors.keys())
        self._bodies: list[Body] = []
        self._places: dict[str, Float] = {}
        self._memory = HoldMemory()
        self._time_ns = 0
        self._view: ScreenView | None = None
        self._log = HoldLog()
        for actor in actors:
            self.place_actor(actor)

    @property
    def characters(self) -> dict[str, Character]:
        """Returns the characters by id. Safe to call from other threads."""
        return {name: actor.character for name, actor in self.actors.copy().items()}

    def place_actor(self, actor: Actor, carried: HoldStarts | None = None, owner: Peer | None = None) -> None:
        """Puts a character on the stage, or replaces the character with the same id.

        The performers who possess the replaced character possess the new one. The caller must have warmed up
        the actor.

        Args:
            carried: the result of :meth:`carry_over` for the actor. If the holds have changed since,
                :meth:`carry_over` is called again.
            owner: the viewer that put the character on the stage; None for the edge itself.
        """
        name = actor.character.id
        replaced = self.actors.get(name)
        if replaced is None:
            actor.aside = self._find_free_place()
        if carried is None or (replaced and carried != self._memory.find_holds(replaced, self._bodies)):
            self.carry_over(actor)
        self.actors[name] = actor
        self.places.set_owner(name, owner)
        if replaced is not None:
            self._log.log_carried_over(actor, self._memory.find_holds(actor, self._bodies))

    def carry_over(self, actor: Actor) -> HoldStarts:
        """Moves all holds from the character with the actor's id to the actor. May run on another thread."""
        replaced = self.actors.get(actor.character.id)
        if self._view is not None and isinstance(actor, ChosenActor):
            actor.view = self._view
        if replaced is None:
            return ()
        return self._memory.carry_over(replaced, actor, self._bodies, self._time_ns)

    def remove(self, character: str) -> None:
        """Removes a character from the stage and ends its holds.

        Raises:
            InputError: if the character does not exist.
        """
        self._log.log_removal(self._updated_actor(character))
        del self.actors[character]
        self._places.pop(character, None)
        self._memory.forget(character)
        self.places.forget(character)

    def sort(self, order: Sequence[str]) -> None:
        """Sorts the characters by a list of ids. Characters that are not in the list come last."""
        first = [name for name in order if name in self.actors]
        for name in [*first, *(name for name in list(self.actors) if name not in first)]:
            self.actors[name] = self.actors.pop(name)

    @property
    def uses_surface(self) -> bool:
        """Returns True if a character follows the visible surface of its performer."""
        return any(actor.uses_surface for actor in self.actors.values())

    def perform(
        self, bodies: list[Body], time_ns: int, surfaces: Callable[[], Surfaces] | None = None
    ) -> list[Pose]:
        """Returns one pose for each character.

        Args:
            bodies: all performers in view, world frame.
            time_ns: nanoseconds, the sensor's clock.
            surfaces: returns the visible surface of each performer by body id. It is called only if a
                character follows surfaces.
        """
        self._bodies, self._time_ns = bodies, time_ns
        visible_surfaces = surfaces() if surfaces is not None and self.uses_surface else None
        poses = []
        for name in self.actors:
            offered, actor = self._sort_bodies(name), self._updated_actor(name)
            self._memory.remember_performer(name, offered)
            with self._log.log_automatic_changes(actor, time_ns):
                pose = actor.perform(offered, time_ns, visible_surfaces)
            self._places[name] = pose.positions.mean(0)[FLOOR]
            poses.append(pose)
        return poses

    def tick(self, frame: Frame, poses: list[Pose], read_ns: int = 0) -> Tick:
        """Returns the complete result of the last performed frame."""
        holders, changes = self.holders, self._log.drain()
        return Tick(frame, self._bodies, poses, read_ns, self.cues(), self.boards(), holders, changes)

    @property
    def has_performer(self) -> bool:
        """Returns True if a performer is in view."""
        return bool(self._bodies)

    @property
    def performer_count(self) -> int:
        """Returns the number of performers in view."""
        return len(self._bodies)

    @property
    def first_in_view(self) -> int | None:
        """Returns the id of the first performer in view, or None."""
        return self._bodies[0].id if self._bodies else None

    @property
    def holders(self) -> frozenset[int]:
        """Returns the ids of the performers who possess a character."""
        return frozenset(hold.body for actor in self.actors.values() for hold in actor.holds)

    def cues(self) -> dict[str, Cues]:
        """Returns by character id the highlighted nodes.

        They are the nodes that performers hold, or would hold if they possessed the character now.
        """
        return {name: self._updated_actor(name).cues(self._sort_bodies(name)) for name in self.actors}

    def possess(
        self,
        character: str | None = None,
        body: int | None = None,
        parts: str = "all",
        mode: Mode = "alone",
    ) -> None:
        """Lets a performer possess a character now.

        The stage chooses the performer or character if it is not given.

        Args:
            character: the character's id. If None, uses that of :meth:`pending_possessions`.
            body: the performer's id. If None, uses that of :meth:`pending_possessions`. In mode "join", this
                is a performer who does not possess the character yet.
            parts: the body parts that possess, names of :data:`enliven.person.body.PARTS`.
            mode: what happens to earlier holds, see :data:`~enliven_edge.stage.actor.Mode`.

        Raises:
            InputError: if the character or the performer does not exist, or if nothing is in reach.
        """
        if character is not None:
            self._possess(character, body, parts, mode)
            return
        refused: list[EnlivenError] = []
        possessions = self.pending_possessions(mode, body)
        for possession in possessions:
            try:
                self._possess(possession.character, possession.body, parts, mode)
            except InputError as error:
                refused.append(error)
        if len(refused) == len(possessions):
            remedy = "Step in front of the sensor, or release a character first."
            problem = "no performer in view is free to possess a character"
            raise refused[0] if refused else InputError(problem, where="stage", remedy=remedy)

    def _possess(self, character: str, body: int | None, parts: str, mode: Mode) -> None:
        """Lets a performer possess the character with this id."""
        actor = self._updated_actor(character)
        present = [b for b in self._sort_bodies(character) if body is None or b.id == body]
        if not present:
            performer_id = "nobody is in view" if body is None else f"performer {body} is not in view"
            raise InputError(
                performer_id, where=f"possessing {character!r}", remedy="Step in front of the sensor first."
            )
        possession = (actor.next_performer(present) if mode == "join" else None) or present[0]
        self._log.possess(actor, possession, parts, mode)
        self._memory.remember(character, possession, parts, mode)

    def find_idle_performer(self, character: str) -> Body | None:
        """Returns the idle performer in view that would possess the character next, or None."""
        return self._updated_actor(character).next_performer(self._sort_bodies(character))

    def candidate(self, character: str, mode: Mode = "alone") -> tuple[int | None, str]:
        """Returns the performer's id and the body parts for a command that names no performer.

        In mode "extend" it is the first performer in view that possesses the character already. The id is
        None if the chosen performer is not in view.
        """
        actor = self._updated_actor(character)
        body, parts = actor.candidate
        present = {performer.id for performer in self._bodies}
        if mode == "extend":
            body = next((hold.body for hold in actor.holds if hold.body in present), body)
        return (body if body in present else None), parts

    def pending_possessions(self, mode: Mode = "alone", body: int | None = None) -> list[PendingPossession]:
        """Returns the pairs of performer and character for a command that names no character.

        The cues show the same pairs. If the stage has a single character, this character is chosen. If it has
        several, each idle performer is paired with the nearest free character, the nearest pairs first. In
        mode "extend" the pairs are the existing holds.

        Args:
            body: the performer's id. If given, only this performer is paired: with the nearest free
                character, or else with the nearest character.
        """
        if len(self.actors) == 1:
            (name,) = self.actors
            first, parts = self.candidate(name, mode)
            return [PendingPossession(name, first if body is None else body, parts)]
        if mode == "extend":
            paired = [(name, hold.body) for name, actor in self.actors.items() for hold in actor.holds]
            paired = [(name, performer_id) for name, performer_id in paired if body in (None, performer_id)]
        else:
            performers = [performer for performer in self._bodies if body in (performer.id, None)]
            paired = pair_nearest(performers, self.actors, self._places, includes_busy=body is not None)
        return [
            PendingPossession(name, performer_id, self.actors[name].candidate[1])
            for name, performer_id in paired
        ]

    def preview(self, character: str | None = None, body: int | None = None, parts: str = "all") -> None:
        """Makes the cues preview the nodes that a performer would hold with these parts.

        If ``body`` is None, the next performer is used.
        """
        for actor in self._select_actors(character):
            actor.preview(body, parts)

    def release(self, character: str | None = None, body: int | None = None) -> None:
        """Ends the hold of one performer, or of all.

        Args:
            character: the character's id. If None, every character that the performer possesses.
        """
        targets = self._select_actors(character)
        if len(targets) > 1 and body is not None:
            targets = [actor for actor in targets if body in {hold.body for hold in actor.holds}]
            if not targets:
                remedy = (
                    f"Performers with a character: {', '.join(map(str, sorted(self.holders))) or 'nobody'}."
                )
                raise InputError(f"performer {body} possesses no character", where="stage", remedy=remedy)
        for actor in targets:
            self._log.release(actor, body)
            self._memory.release(actor.character.id, body)

    def set_view(self, view: ScreenView) -> None:
        """Sets the viewer's direction of view.

        Rigged characters compare poses as they appear on the screen.
        """
        self._view = view
        for actor in self._rig_actors():
            actor.view = view

    def browse(self, character: str | None = None, step: int = 1) -> None:
        """Shows another match of a rigged character. With step 0, the match follows the pose again.

        Args:
            character: the character's id. If None, every rigged character.

        Raises:
            InputError: if the character does not exist, or it is not rigged.
        """
        targets = self._select_actors(character)
        rigs = [actor for actor in targets if isinstance(actor, ChosenActor)]
        if not rigs:
            where = f"character {targets[0].character.id!r}"
            remedy = "Start the edge with a rigged model and --drive skeleton."
            raise InputError("the parts of this character cannot be chosen", where=where, remedy=remedy)
        for actor in rigs:
            actor.browse(step)

    def boards(self) -> list[MatchList]:
        """Returns for each rigged character the list of matches to choose from."""
        return [actor.board() for actor in self._rig_actors()]

    def _rig_actors(self) -> list[ChosenActor]:
        return [actor for actor in self.actors.values() if isinstance(actor, ChosenActor)]

    def _updated_actor(self, character: str) -> Actor:
        """Returns the actor of a character. Informs it first which performers are busy with other
        characters.
        """
        if character not in self.actors:
            names = ", ".join(self.actors) or "none"
            problem = f"there is no character {character!r}"
            raise InputError(problem, where="stage", remedy=f"Characters on the stage: {names}.")
        actor = self.actors[character]
        others = (other for other in self.actors.values() if other is not actor)
        actor.busy = frozenset(hold.body for other in others for hold in other.holds)
        return actor

    def _select_actors(self, character: str | None) -> list[Actor]:
        """Returns the actor with this id, or all actors. Raises InputError if the stage is empty."""
        if character is not None or not self.actors:
            return [self._updated_actor(character or "")]
        return [self._updated_actor(name) for name in self.actors]

    def _sort_bodies(self, character: str) -> list[Body]:
        """Returns the bodies in the order in which the stage offers them a character."""
        if len(self.actors) < 2:
            return self._bodies
        return order_performers(
            self._bodies, self._updated_actor(character).busy, self._places.get(character)
        )

    def _find_free_place(self) -> float:
        """Returns the sideways offset in metres for an additional character next to the existing ones."""
        widths = [np.ptp(actor.character.vertices[:, 0]) for actor in self.actors.values()]
        offsets = [actor.aside for actor in self.actors.values()]
        return max(
            (a + float(w) + _CHARACTER_GAP_M for a, w in zip(offsets, widths, strict=True)), default=0.0
        )
