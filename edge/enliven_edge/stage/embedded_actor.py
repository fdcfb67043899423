"""One character on the stage: free, or held by performers, and never jumping between the two."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from enliven.arrays import Float
from enliven.deformation.constraints import ObservedPoints
from enliven.deformation.embedded import EmbeddedSolver
from enliven.deformation.graph import DeformationGraph, stiffness_at
from enliven.document import Character, Pose
from enliven.errors import EnlivenError, InputError
from enliven.person import Body, parts_named
from enliven_edge.stage.actor import Mode
from enliven_edge.stage.actor_settings import ActorSettings
from enliven_edge.stage.easing import Fading
from enliven_edge.stage.grip import gripped, out_of_reach
from enliven_edge.stage.highlights import Cues, State, cues_of
from enliven_edge.stage.hold import Grip, Hold, depth_of, joined
from enliven_edge.stage.placement import AS_MODELLED, resettled
from enliven_edge.stage.placement_rules import Whereabouts
from enliven_edge.stage.soft_constraints import SoftTerms
from enliven_edge.tracking.body_model import Posture, lengths_for_height, standing

_STEP_NS = 33_333_333
"""Nanoseconds between the frames of a rehearsal."""


class EmbeddedActor:
    """A character, the graph that deforms it, and who holds it.

    Everything is solved in the rest space of the mesh; the placement carries it into the world.

    Args:
        size: metres of the mesh as modelled for one of its rest space.
    """

    def __init__(
        self,
        character: Character,
        graph: DeformationGraph,
        settings: ActorSettings | None = None,
        size: float = 1.0,
    ) -> None:
        self.character, self.graph = character, graph
        self.settings = settings or ActorSettings()
        self.holds: list[Hold] = []
        height = float(np.ptp(character.vertices[:, 1])) or 1.0
        self._where = Whereabouts(self.settings, graph, height, size)
        self._placement = AS_MODELLED
        self._met = self.settings.place == "fixed"
        self._solver: EmbeddedSolver | None = None
        self._fading = Fading(self.settings.fade, self.settings.fade_pace)
        self._soft = SoftTerms(character, graph, self.settings)
        self._stiffness = stiffness_at(graph.positions, self.settings.stiffness)
        self._time_ns = 0
        self._seen = False
        self._candidate: tuple[int | None, str] = (None, "all")

    @property
    def uses_surface(self) -> bool:
        """Whether it follows what the sensor sees of its performers' surfaces."""
        return self.settings.follow != "skeleton"

    @property
    def state(self) -> State:
        """Whether somebody holds it."""
        return "possessed" if self.holds else "free"

    @property
    def candidate(self) -> tuple[int | None, str]:
        """Who takes hold next, None for the first in view, and with what."""
        return self._candidate

    @property
    def body_id(self) -> int:
        """Who has held it longest; -1 for nobody."""
        return self.holds[0].body if self.holds else -1

    def possess(self, body: Body, parts: str = "all", mode: Mode = "alone") -> None:
        """The body takes hold of the mesh where both are now.

        Args:
            parts: what of the body.
            mode: "alone": everybody else lets go; "join": the others go on, and what this performer held is
                let go; "extend": that is kept too, except of bones that take hold anew.

        Raises:
            InputError: for an unknown part, or where nothing of the mesh can be reached; the actor stays as
                it was.
        """
        others = [hold for hold in self.holds if mode != "alone" and hold.body != body.id]
        own = next((hold for hold in self.holds if mode == "extend" and hold.body == body.id), None)
        grip = self._grip(body, parts, others if own is None else [own, *others])
        if not len(grip.attachment):
            state = self._shown_at_rest()
            nodes = self.graph.positions if state is None else state[1]
            raise out_of_reach(self.character.id, self.settings, body, grip, nodes)
        hold = (
            Hold(body.id, [grip], self._time_ns, depth=depth_of(body)) if own is None else own.with_grip(grip)
        )
        kept = others or own is not None or self._stays
        start = self._solver.state() if kept and self._solver is not None else None
        if not kept:
            self._placement = self._where.stands(body)
        self._met, self._candidate = True, (None, parts)
        at = next((i for i, h in enumerate(self.holds) if h.body == body.id), len(others))
        self._hold([*others[:at], hold, *others[at:]], start)

    def release(self, body: int | None = None) -> None:
        """A performer lets go, or everybody; the mesh of nobody eases back to its rest shape where it is.

        Raises:
            InputError: where that performer holds nothing of it.
        """
        left = [hold for hold in self.holds if body is not None and hold.body != body]
        if body is not None and len(left) == len(self.holds):
            who = ", ".join(str(hold.body) for hold in self.holds) or "nobody"
            raise InputError(
                f"performer {body} does not hold it",
                where=f"releasing {self.character.id!r}",
                mend=f"It is held by: {who}.",
            )
        if left:
            self._hold(left, self._solver.state() if self._solver is not None else None)
        elif self.holds:
            if self._fading.shown is not None:
                shown = self._fading.shown[1]
                self._placement = resettled(self._placement, self.graph.positions, shown)
            self.holds, self._solver = [], None
            self._fading.tear()

    def preview(self, body: int | None = None, parts: str = "all") -> None:
        """From now on, show what this performer (whoever comes next where None) would hold with these parts.

        Raises:
            InputError: for an unknown part.
        """
        parts_named(parts)
        self._candidate = (body, parts)

    def perform(
        self, bodies: list[Body], time_ns: int, seen: Mapping[int, ObservedPoints] | None = None
    ) -> Pose:
        """The pose at a moment: of the possession, or of the mesh waiting where it stands.

        Args:
            seen: the surface that the sensor sees of each performer, where it sees depth.
        """
        if not self._met and bodies and not self.holds:
            self._placement, self._met = self._where.waits(bodies[0]), True
        self._hand_over(bodies, time_ns)
        self._look_for_performers(bodies, time_ns)
        world = self._placement.state_to_world(*self._solved(seen or {}, time_ns))
        linear, positions = self._fading(*world, time_ns)
        self._time_ns = time_ns
        return Pose(self.character.id, time_ns, linear.astype(np.float32), positions.astype(np.float32))

    def next_performer(self, bodies: list[Body]) -> Body | None:
        """Who would take hold: the first who holds nothing of it."""
        holders = {hold.body for hold in self.holds}
        return next((body for body in bodies if body.id not in holders), None)

    def cues(self, bodies: list[Body]) -> Cues:
        """What is held, and what the next performer would hold if they took hold now, beside those who do."""
        who, parts = self._candidate
        body = next((b for b in bodies if b.id == who), None) or self.next_performer(bodies)
        count = len(self.graph.positions)
        held = [(hold.body, hold.strengths(count)) for hold in self.holds if hold.active]
        preview = None
        if body is not None and self._met:
            others = [hold for hold in self.holds if hold.body != body.id]
            preview = body.id, Hold(body.id, [self._grip(body, parts, others)]).strengths(count)
        return cues_of(held, preview)

    def warm_up(self) -> None:
        """Possesses a copy for a few frames, so that no frame waits for a compiler."""
        rehearsal = EmbeddedActor(self.character, self.graph, self.settings)
        posture = Posture(np.array([0.0, 0.95, 0.0]), standing(elbow=1.5), lengths_for_height(1.75))
        body = Body(0, posture.joints(), np.ones(20))
        rehearsal.perform([body], 0)
        rehearsal.cues([body])
        try:
            rehearsal.possess(body)
        except EnlivenError:  # a mesh out of reach is for the performer to see, later
            return
        for i in range(3):
            moved = Body(0, body.joints + 0.01 * i, body.confidence * (1 - 0.1 * i))
            seen = ObservedPoints(moved.joints, np.tile([0.0, 0.0, 1.0], (20, 1)))
            rehearsal.perform([moved], (i + 1) * _STEP_NS, {0: seen})

    @property
    def _stays(self) -> bool:
        """Whether the mesh keeps its place and shape when somebody takes hold alone."""
        return self.settings.place == "fixed" or self.settings.how != "inside"

    def _grip(self, body: Body, parts: str, others: list[Hold]) -> Grip:
        """What the body would hold now, beside others; empty where nothing is in reach."""
        deformed = None
        if (self.holds or self._fading.under_way) and (others or self._stays):
            deformed = self._shown_at_rest()
        ways = self._where.ways(body, self._placement, [hold.grips[0].carrying for hold in others])
        for carrying in ways:
            grip = gripped(self.graph, self.settings, body, parts, carrying, deformed)
            if len(grip.attachment):
                break
        return grip

    def _shown_at_rest(self) -> tuple[Float, Float] | None:
        """The nodes as they are shown, in the rest space: a performer takes hold of what they see."""
        shown = self._fading.shown
        return None if shown is None else self._placement.state_to_rest(*shown)

    def _hold(self, holds: list[Hold], start: tuple[Float, Float] | None) -> None:
        """From now on these hold; what is shown eases over."""
        self.holds = holds
        self._soft.moved_elsewhere()
        self._solver = EmbeddedSolver(
            self.graph, joined(holds), self.settings.embedded, start, self._stiffness
        )
        self._fading.tear()

    def _hand_over(self, bodies: list[Body], time_ns: int) -> None:
        """Who alone holds nothing goes on for who has been away for long."""
        patience, present = self.settings.hand_over, {body.id for body in bodies}
        away = [h for h in self.holds if h.body not in present and h.away(time_ns) > patience]
        idle = [body for body in bodies if body.id not in {hold.body for hold in self.holds}]
        if patience > 0 and away and len(idle) == 1:
            hold = max(away, key=lambda h: h.away(time_ns))
            hold.body, hold.depth = idle[0].id, depth_of(idle[0])
            for grip in hold.grips:
                grip.carrying.handed_over(idle[0])
            self._fading.tear()

    def _look_for_performers(self, bodies: list[Body], time_ns: int) -> None:
        """Everybody's targets; who is away for longer than a moment lets go, unless nobody else is there."""
        present = {body.id: body for body in bodies}
        sunk = {h.body for h in self.holds if h.body in present and not h.believes(present[h.body])}
        if any(hold.body in present and hold.body not in sunk for hold in self.holds):
            present = {own: body for own, body in present.items() if own not in sunk}
        self._seen = any(hold.body in present for hold in self.holds)
        for hold in self.holds if self._seen else []:
            gone = hold.away(time_ns) > self.settings.patience
            body = present.get(hold.body)
            if gone and (body is not None or hold.active):
                self._fading.tear()
            hold.active = body is not None or not gone
            if body is not None:
                hold.see(body, time_ns)

    def _solved(self, seen: Mapping[int, ObservedPoints], time_ns: int) -> tuple[Float, Float]:
        """The graph's linear parts and positions in the rest space; as they were where nobody is there."""
        if self._solver is None:
            return np.tile(np.eye(3), (len(self.graph.positions), 1, 1)), self.graph.positions
        floor = float(self._placement.to_rest(np.zeros(3))[1])
        if not self._seen:
            return self._soft.raised(*self._solver.state(), floor)
        own = [hold.targets for hold in self.holds]
        if self.settings.follow == "surface":
            unseen = [hold.body not in seen for hold in self.holds]
            own = [(where, pulls * alone) for (where, pulls), alone in zip(own, unseen, strict=True)]
        targets, pulls = (np.concatenate(part) for part in zip(*own, strict=True))
        seconds = max(time_ns - self._time_ns, 0) * 1e-9
        planes = self._soft.planes(self._solver.state(), self.holds, seen, floor, seconds)
        return self._soft.raised(*self._solver.solve(targets, pulls, planes=planes), floor)
