"""The actor of a possessed mesh: performers hold it, and an embedded deformation graph moves it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from enliven.arrays import Float
from enliven.deformation.constraints import ObservedPoints
from enliven.deformation.embedded import EmbeddedSolver
from enliven.deformation.graph import DeformationGraph
from enliven.document import Character, Pose
from enliven.errors import EnlivenError
from enliven.person import Body, J
from enliven.possession.actor import Actor, Mode
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.attachment_reach import attach_within_reach, out_of_reach
from enliven.possession.follow_through import FollowThrough, stiffness_of
from enliven.possession.highlights import Cues, cues_of
from enliven.possession.likeness import BodyInMesh
from enliven.possession.limb_retargeting import LimbRetargeting
from enliven.possession.performer_attachment import (
    PerformerAttachment,
    TransformedAttachment,
    depth_of,
    joined,
)
from enliven.possession.placement import AS_MODELLED, Placement, resettled
from enliven.possession.placement_rules import PlacementRules
from enliven.possession.pose_approach import PoseApproach
from enliven.possession.pose_blend import PoseBlend
from enliven.possession.soft_constraints import SoftConstraints
from enliven.possession.standing_placement import standing_figure

_STEP_NS = 33_333_333
"""Nanoseconds between the frames of the warm-up run."""


class EmbeddedActor(Actor):
    """A character, the deformation graph that moves it, and the performers' holds on it.

    The mesh is solved in its rest space; the placement transforms the result into the world.

    Args:
        size: metres of the mesh as modelled per metre of its rest space.
        height: metres, height of the mesh at rest. Its scale on the stage is computed from it. None measures
            it.
        person: waits for the result of the search for a person in the mesh, which runs in the background.
            None searches when the result is needed.
    """

    settings: ActorSettings

    def __init__(
        self,
        character: Character,
        graph: DeformationGraph,
        settings: ActorSettings | None = None,
        size: float = 1.0,
        height: float | None = None,
        person: Callable[[], BodyInMesh | None] | None = None,
    ) -> None:
        self.character, self.graph = character, graph
        self.settings = settings or ActorSettings()
        self.holds: list[PerformerAttachment] = []
        self.size = size
        height = height or float(np.ptp(character.vertices[:, 1])) or 1.0
        self._rules = PlacementRules(self.settings, character, graph, height, size, person)
        self._placement = AS_MODELLED
        self._placed = self.settings.place == "fixed"
        self._solver: EmbeddedSolver | None = None
        self._approach: PoseApproach | None = None
        self._free = True
        self._easing = PoseBlend(self.settings.fade, self.settings.fade_pace)
        self._soft = SoftConstraints(character, graph, self.settings)
        self._stiffness = stiffness_of(character, graph.positions, self.settings.stiffness)
        self._swing = FollowThrough(self._stiffness, self.settings.exaggeration)
        self._time_ns, self._turned = 0, 0.0
        self._seen = False

    @property
    def uses_surface(self) -> bool:
        """Whether the mesh follows the observed surface of its performers."""
        return self.settings.follow != "skeleton"

    @property
    def likeness(self) -> BodyInMesh | None:
        """The person-like skeleton in the mesh, if limb drives limb."""
        return self._rules.likeness

    @property
    def place(self) -> tuple[float, ...]:
        """The placement of the mesh: scale, radians about +Y, x, y, z in metres."""
        return self._placement.scale, self._placement.yaw, *self._placement.offset.tolist()

    @property
    def body_id(self) -> int:
        """The id of the performer that has held the mesh longest; -1 while it is free."""
        return self.holds[0].body if self.holds else -1

    def possess(self, body: Body, parts: str = "all", mode: Mode = "alone") -> None:
        """Attaches the body to the mesh at their current poses.

        Args:
            parts: the parts of the body that attach.
            mode: "alone" ends the holds of all other performers. "join" keeps the holds of other performers
                and ends this performer's earlier hold. "extend" keeps that too, except for bones that attach
                again.

        Raises:
            InputError: if a part is unknown, or if no part of the mesh is within reach. The actor is then
                unchanged.
        """
        others = [hold for hold in self.holds if mode != "alone" and hold.body != body.id]
        own = next((hold for hold in self.holds if mode == "extend" and hold.body == body.id), None)
        grip = self._grip_of_body(body, parts, others if own is None else [own, *others])
        if not len(grip.attachment):
            state = self._shown_at_rest()
            nodes = self.graph.positions if state is None else state[1]
            comes = not (others or own is not None or self._is_stationary)
            raise out_of_reach(self.character.id, self.settings, body, grip, nodes, comes=comes)
        new = PerformerAttachment(body.id, [grip], self._time_ns, depth=depth_of(body))
        hold = new if own is None else own.with_attachment(grip)
        continues = others or own is not None or self._is_stationary
        start = self._solver.state() if continues and self._solver is not None else None
        if self._approach is not None:
            start = start or self._approach.state
            if self._approach.body == body.id and isinstance(grip.rest_transform, LimbRetargeting):
                grip.rest_transform.goes_on(self._approach.rest_transform)
        self._approach, self._free = None, False
        if not continues:
            self._placement = self._display_placement(self._rules.at_performer(body))
        self._placed, self._candidate = True, (None, parts)
        at = next((i for i, h in enumerate(self.holds) if h.body == body.id), len(others))
        self._replace_holds([*others[:at], hold, *others[at:]], start)

    def release(self, body: int | None = None) -> None:
        """Ends the hold of one performer, or of all. A free mesh eases to its rest shape at its current
        place.

        Raises:
            InputError: if that performer does not hold this mesh.
        """
        self._need_holder(body, ("hold", "held"))
        remaining = [hold for hold in self.holds if body is not None and hold.body != body]
        if remaining:
            self._replace_holds(remaining, self._solver.state() if self._solver is not None else None)
        elif self.holds:
            if self._easing.shown is not None:
                shown = self._easing.shown[1]
                self._placement = resettled(self._placement, self.graph.positions, shown)
            self.holds, self._solver = [], None
            self._swing.restart()
            self._easing.restart_fade()

    def stand(self, place: tuple[float, ...]) -> None:
        """Places the waiting mesh: scale, radians about +Y, and x, y, z in metres."""
        self._placement, self._placed = Placement(place[0], place[1], np.array(place[2:5])), True

    def resize(self, growth: float, about: Float | None = None, *, fade: bool = False) -> None:
        """Sets the display scale relative to the own size. Holds are stored in the rest space, so they scale
        too.
        """
        factor, self.growth = growth / self.growth, growth
        if self._placed and factor != 1.0:
            place = self._placement.to_world(self._rules.stand) * [1.0, 0.0, 1.0] if about is None else about
            self._placement = self._placement.larger(factor, place)
            if fade:
                self._easing.restart_fade()

    def exaggerate(self, exaggeration: float | None) -> None:
        """Sets how far soft parts swing past the motion. None uses the value in the settings."""
        self.exaggeration = exaggeration
        self._swing.exaggerate(self.settings.exaggeration if exaggeration is None else exaggeration)

    def hand_over(self, former: int, body: Body) -> None:
        """Transfers the hold of one performer to another performer, starting from the same pose."""
        for hold in self.holds:
            if hold.body == former:
                hold.body, hold.depth = body.id, depth_of(body)
                for grip in hold.attachments:
                    grip.rest_transform.handed_over(body)
                self._easing.restart_fade()

    def perform(
        self, bodies: list[Body], time_ns: int, seen: Mapping[int, ObservedPoints] | None = None
    ) -> Pose:
        """Returns the pose at a moment: driven by its performers, or waiting at its place.

        Args:
            seen: by body id, the part of the performer's surface that a depth sensor sees.
        """
        if not self._placed and bodies and not self.holds:
            place, self._placed = self._rules.waiting_place(bodies[0], self.aside), True
            self._placement = self._display_placement(place)
            self._easing.restart()
        self._hand_over(bodies, time_ns)
        self._update_holds(bodies, time_ns)
        self._ease_into_pose(bodies, time_ns)
        world = self._placement.state_to_world(*self._solved_state(bodies, seen or {}, time_ns))
        self._easing.turn_along(self._turned)
        linear, positions = self._easing(*world, time_ns)
        self._time_ns = time_ns
        return Pose(self.character.id, time_ns, linear.astype(np.float32), positions.astype(np.float32))

    def cues(self, bodies: list[Body]) -> Cues:
        """Returns the nodes that are held, and the nodes that the next performer would hold in addition."""
        who, parts = self._candidate
        body = next((b for b in bodies if b.id == who), None) or self.next_performer(bodies)
        count = len(self.graph.positions)
        held_strengths = [(hold.body, hold.strengths(count)) for hold in self.holds if hold.active]
        preview = None
        if body is not None and self._placed:
            others = [hold for hold in self.holds if hold.body != body.id]
            preview = (
                body.id,
                PerformerAttachment(body.id, [self._grip_of_body(body, parts, others)]).strengths(count),
            )
        return cues_of(held_strengths, preview)

    def warm_up(self) -> None:
        """Possesses a copy for a few frames, so that no frame waits for compilation."""
        rehearsal = EmbeddedActor(self.character, self.graph, self.settings)
        # Reuse the rules, because they already contain the result of the slow skeleton search.
        rehearsal._rules = self._rules
        body = Body(0, standing_figure(), np.ones(J))
        rehearsal.perform([body], 0)
        rehearsal.cues([body])
        try:
            rehearsal.possess(body)
        except EnlivenError:  # The error is reported later, when a performer attaches.
            return
        for i in range(3):
            moved = Body(0, body.joints + 0.01 * i, body.confidence * (1 - 0.1 * i))
            observed = ObservedPoints(moved.joints, np.tile([0.0, 0.0, 1.0], (J, 1)))
            rehearsal.perform([moved], (i + 1) * _STEP_NS, {0: observed})
            if rehearsal._solver is not None:
                rehearsal._solver.renew()

    @property
    def _is_stationary(self) -> bool:
        """Whether the mesh keeps its place and shape when a single performer attaches."""
        return self.settings.place == "fixed" or self.settings.how != "inside"

    def _display_placement(self, place: Placement) -> Placement:
        """Returns a placement at the mesh's own size scaled to its display size."""
        return place.larger(self.growth, place.to_world(self._rules.stand))

    def _grip_of_body(
        self, body: Body, parts: str, others: list[PerformerAttachment]
    ) -> TransformedAttachment:
        """Returns the grip that the body would get now, in addition to other holds. Empty if nothing is
        within reach.
        """
        deformed = None
        if (self.holds or self._easing.under_way) and (others or self._is_stationary):
            deformed = self._shown_at_rest()
        earlier = [hold.attachments[0].rest_transform for hold in others]
        own = next((hold.attachments[0].rest_transform for hold in self.holds if hold.body == body.id), None)
        for rest_transform in self._rules.rest_transforms(body, self._placement, earlier, own):
            grip = attach_within_reach(self.graph, self.settings, body, parts, rest_transform, deformed)
            if len(grip.attachment):
                break
        return grip

    def _shown_at_rest(self) -> tuple[Float, Float] | None:
        """Returns the shown nodes in the rest space, because performers attach to the shown mesh."""
        shown = self._easing.shown
        return None if shown is None else self._placement.state_to_rest(*shown)

    def _replace_holds(self, holds: list[PerformerAttachment], start: tuple[Float, Float] | None) -> None:
        """Replaces the holds and the solver, and eases the shown state over the change."""
        self.holds = holds
        self._soft.moved_elsewhere()
        self._swing.restart()
        self._solver = EmbeddedSolver(
            self.graph, joined(holds), self.settings.embedded, start, self._stiffness
        )
        self._easing.restart_fade()

    def _hand_over(self, bodies: list[Body], time_ns: int) -> None:
        """Gives the hold of a performer that has been away longer than ``hand_over`` to the only idle one in
        view.
        """
        patience, present = self.settings.hand_over, {body.id for body in bodies}
        away = [h for h in self.holds if h.body not in present and h.away(time_ns) > patience]
        idle = self._free_bodies(bodies)
        if patience > 0 and away and len(idle) == 1:
            self.hand_over(max(away, key=lambda h: h.away(time_ns)).body, idle[0])

    def _update_holds(self, bodies: list[Body], time_ns: int) -> None:
        """Updates the targets of all holds. A performer that is away releases the mesh, unless all holders
        are away.
        """
        present = {body.id: body for body in bodies}
        sunk = {h.body for h in self.holds if h.body in present and not h.believes(present[h.body])}
        if any(hold.body in present and hold.body not in sunk for hold in self.holds):
            present = {own: body for own, body in present.items() if own not in sunk}
        self._seen = any(hold.body in present for hold in self.holds)
        self._turned = 0.0
        for hold in self.holds if self._seen else []:
            is_lost = hold.away(time_ns) > self.settings.patience
            body = present.get(hold.body)
            if is_lost and (body is not None or hold.active):
                self._easing.restart_fade()
            hold.active = body is not None or not is_lost
            if body is not None:
                was_seen = hold.seen_ns == self._time_ns
                hold.see(body, time_ns)
                if was_seen and len(self.holds) == 1 and isinstance(hold.rest_transform, LimbRetargeting):
                    self._turned = hold.rest_transform.turned

    def _ease_into_pose(self, bodies: list[Body], time_ns: int) -> None:
        """Eases a mesh that has not been held yet into the pose of the performer that holds it next."""
        body = self.next_performer(bodies) if self._free and self._placed else None
        if body is None:
            return
        if self._approach is not None and self._approach.body == body.id:
            if self._approach.away(time_ns) > self.settings.patience:
                self._easing.restart_fade()
            return
        rest_transform = self._rules.meeting(body, self._placement)
        if rest_transform is not None:
            start = None if self._approach is None else self._approach.state
            fit = (body, rest_transform, self._stiffness, start)
            self._approach = PoseApproach(self.graph, self.settings, *fit)
            self._swing.restart()
            self._easing.restart_fade()

    def _solved_state(
        self, bodies: list[Body], seen: Mapping[int, ObservedPoints], time_ns: int
    ) -> tuple[Float, Float]:
        """Returns (N, 3, 3) linear parts and (N, 3) positions in the rest space; the last ones if no holder
        is in view.
        """
        if self._approach is None and self._solver is None:
            return np.tile(np.eye(3), (len(self.graph.positions), 1, 1)), self.graph.positions
        floor = float(self._placement.to_rest(np.zeros(3))[1])
        if self._approach is not None:
            own = next((body for body in bodies if body.id == self._approach.body), None)
            linear, positions = self._approach.at(own, time_ns)
        else:
            linear, positions = self._held_state(seen, floor, time_ns)
        return self._soft.raise_above_floor(linear, self._swing(positions, time_ns), floor)

    def _held_state(
        self, seen: Mapping[int, ObservedPoints], floor: float, time_ns: int
    ) -> tuple[Float, Float]:
        """Returns the state of the mesh as its holders deform it."""
        assert self._solver is not None
        if not self._seen:
            return self._solver.state()
        own = [hold.targets for hold in self.holds]
        if self.settings.follow == "surface":
            unseen = [hold.body not in seen for hold in self.holds]
            own = [(where, pulls * alone) for (where, pulls), alone in zip(own, unseen, strict=True)]
        targets, pulls = (np.concatenate(part) for part in zip(*own, strict=True))
        seconds = max(time_ns - self._time_ns, 0) * 1e-9
        planes = self._soft.planes(self._solver.state(), self.holds, seen, floor, seconds)
        return self._solver.solve(targets, pulls, planes=planes)
