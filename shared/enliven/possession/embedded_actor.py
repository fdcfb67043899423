"""An actor with a mesh that is moved by an embedded deformation graph. Performers attach to the graph's
nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from enliven.arrays import Float
from enliven.deformation.constraints.observed import ObservedPoints
from enliven.deformation.embedded.solver import EmbeddedSolver
from enliven.deformation.graph.graph import DeformationGraph
from enliven.document import Character, Pose
from enliven.errors import EnlivenError
from enliven.person import Body, J
from enliven.possession.actor import Actor, Mode
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.attachment.limb_retargeting import LimbRetargeting
from enliven.possession.attachment.performer_attachment import (
    PerformerAttachment,
    TransformedAttachment,
    attach_within_reach,
    depth_below_floor,
    join_constraints,
    make_out_of_reach_error,
)
from enliven.possession.easing.follow_through import FollowThrough, node_stiffness
from enliven.possession.easing.pose_approach import PoseApproach
from enliven.possession.easing.pose_blend import PoseBlend
from enliven.possession.highlights import Cues, make_cues
from enliven.possession.likeness.skeleton import BodyInMesh
from enliven.possession.likeness.standing_person import make_standing_figure
from enliven.possession.placement import AS_MODELLED, Placement, find_nearest_placement
from enliven.possession.placement_rules import PlacementRules
from enliven.possession.soft_constraints import SoftConstraints

_STEP_NS = 33_333_333
"""Nanoseconds between the frames of the warm-up run."""


class EmbeddedActor(Actor):
    """A character with its deformation graph and its attached performers.

    The mesh is solved in its rest space. The placement transforms the result into the world.

    Args:
        size: metres of the mesh as modelled per metre of its rest space.
        height: height of the mesh at rest, metres. It determines the scale on the stage. If None, the height
            is measured.
        person: a function that waits for the background search for a person in the mesh, and returns its
            result. If None, the actor itself runs the search when it needs the result.
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
        self._stiffness = node_stiffness(character, graph.positions, self.settings.stiffness)
        self._swing = FollowThrough(self._stiffness, self.settings.exaggeration)
        self._time_ns, self._turned = 0, 0.0
        self._seen = False

    @property
    def uses_surface(self) -> bool:
        """True if the mesh follows the observed surface of its performers."""
        return self.settings.follow != "skeleton"

    @property
    def likeness(self) -> BodyInMesh | None:
        """The person-like skeleton in the mesh if the mesh is driven limb by limb, otherwise None."""
        return self._rules.likeness

    def set_likeness(self, likeness: BodyInMesh | None) -> None:
        """Sets the skeleton in the mesh, if it is known from an earlier search."""
        self._rules.likeness = likeness

    @property
    def place(self) -> tuple[float, ...]:
        """The placement of the mesh: scale, radians about +Y, x, y, z in metres."""
        return self._placement.scale, self._placement.yaw, *self._placement.offset.tolist()

    @property
    def body_id(self) -> int:
        """The id of the performer who has been attached longest, or -1 if no performer is attached."""
        return self.holds[0].body if self.holds else -1

    def possess(self, body: Body, parts: str = "all", mode: Mode = "alone") -> None:
        """Attaches the body to the mesh at their current poses.

        Args:
            parts: the parts of the body that attach.
            mode: "alone" detaches all other performers. "join" keeps other performers attached and replaces
                this performer's earlier attachment. "extend" also keeps this performer's earlier attachment,
                except for bones that attach again.

        Raises:
            InputError: if a part is unknown, or if no part of the mesh is within reach. The actor is then
                unchanged.
        """
        others = [hold for hold in self.holds if mode != "alone" and hold.body != body.id]
        earlier_hold = next((hold for hold in self.holds if mode == "extend" and hold.body == body.id), None)
        grip = self._attachment_for_body(
            body, parts, others if earlier_hold is None else [earlier_hold, *others]
        )
        if not len(grip.attachment):
            state = self._is_shown_at_rest()
            nodes = self.graph.positions if state is None else state[1]
            comes = not (others or earlier_hold is not None or self._is_stationary)
            raise make_out_of_reach_error(self.character.id, self.settings, body, grip, nodes, comes=comes)
        new = PerformerAttachment(body.id, [grip], self._time_ns, depth=depth_below_floor(body))
        hold = new if earlier_hold is None else earlier_hold.with_attachment(grip)
        continues = others or earlier_hold is not None or self._is_stationary
        start = self._solver.state() if continues and self._solver is not None else None
        if self._approach is not None:
            start = start or self._approach.state
            if self._approach.body == body.id and isinstance(grip.rest_transform, LimbRetargeting):
                grip.rest_transform.continue_from(self._approach.rest_transform)
        self._approach, self._free = None, False
        if not continues:
            self._placement = self._display_placement(self._rules.placement_at(body))
        self._placed, self._candidate = True, (None, parts)
        hold_index = next((i for i, h in enumerate(self.holds) if h.body == body.id), len(others))
        self._replace_holds([*others[:hold_index], hold, *others[hold_index:]], start)

    def release(self, body: int | None = None) -> None:
        """Detaches one performer, or all performers if ``body`` is None. A mesh without performers eases to
        its rest shape at its current position.

        Raises:
            InputError: if that performer is not attached to this mesh.
        """
        self._require_holder(body, ("hold", "held"))
        remaining = [hold for hold in self.holds if body is not None and hold.body != body]
        if remaining:
            self._replace_holds(remaining, self._solver.state() if self._solver is not None else None)
        elif self.holds:
            if self._easing.shown is not None:
                shown_positions = self._easing.shown[1]
                self._placement = find_nearest_placement(
                    self._placement, self.graph.positions, shown_positions
                )
            self.holds, self._solver = [], None
            self._swing.restart()
            self._easing.restart_fade()

    def stand(self, place: tuple[float, ...]) -> None:
        """Places the waiting mesh: scale, radians about +Y, and x, y, z in metres."""
        self._placement, self._placed = Placement(place[0], place[1], np.array(place[2:5])), True

    def resize(self, growth: float, about: Float | None = None, *, fade: bool = False) -> None:
        """Sets the display scale relative to the mesh's own size. Attachments stay valid, because they are
        stored in the rest space.
        """
        factor, self.growth = growth / self.growth, growth
        if self._placed and factor != 1.0:
            place = self._placement.to_world(self._rules.stand) * [1.0, 0.0, 1.0] if about is None else about
            self._placement = self._placement.scale_about(factor, place)
            if fade:
                self._easing.restart_fade()

    def exaggerate(self, exaggeration: float | None) -> None:
        """Sets the factor on the overshoot of soft parts that swing. None uses the value in the settings."""
        self.exaggeration = exaggeration
        self._swing.set_exaggeration(self.settings.exaggeration if exaggeration is None else exaggeration)

    def hand_over(self, former: int, body: Body) -> None:
        """Transfers the attachment of the performer ``former`` to another performer, starting from the same
        pose."""
        for hold in self.holds:
            if hold.body == former:
                hold.body, hold.depth = body.id, depth_below_floor(body)
                for grip in hold.attachments:
                    grip.rest_transform.hand_over_to(body)
                self._easing.restart_fade()

    def perform(
        self, bodies: list[Body], time_ns: int, seen: Mapping[int, ObservedPoints] | None = None
    ) -> Pose:
        """Returns the pose at a time. Attached performers drive the mesh. Without them it waits at its
        position.

        Args:
            seen: by body id, the part of the performer's surface that a depth sensor sees.
        """
        if not self._placed and bodies and not self.holds:
            place, self._placed = self._rules.compute_waiting_placement(bodies[0], self.aside), True
            self._placement = self._display_placement(place)
            self._easing.restart()
        self._hand_over(bodies, time_ns)
        self._update_holds(bodies, time_ns)
        self._ease_into_pose(bodies, time_ns)
        world = self._placement.state_to_world(*self._solve_state(bodies, seen or {}, time_ns))
        self._easing.turn_along(self._turned)
        linear, positions = self._easing(*world, time_ns)
        self._time_ns = time_ns
        return Pose(self.character.id, time_ns, linear.astype(np.float32), positions.astype(np.float32))

    def cues(self, bodies: list[Body]) -> Cues:
        """Returns the nodes that performers are attached to, and the nodes that the next performer would
        attach to."""
        performer, parts = self._candidate
        body = next((b for b in bodies if b.id == performer), None) or self.next_performer(bodies)
        count = len(self.graph.positions)
        held_strengths = [(hold.body, hold.strengths(count)) for hold in self.holds if hold.active]
        preview = None
        if body is not None and self._placed:
            others = [hold for hold in self.holds if hold.body != body.id]
            preview = (
                body.id,
                PerformerAttachment(body.id, [self._attachment_for_body(body, parts, others)]).strengths(
                    count
                ),
            )
        return make_cues(held_strengths, preview)

    def warm_up(self) -> None:
        """Drives a copy of the actor for a few frames, so that no live frame has to wait for compilation."""
        rehearsal = EmbeddedActor(self.character, self.graph, self.settings)
        # Reuse the placement rules, because they already contain the result of the slow skeleton search.
        rehearsal._rules = self._rules
        body = Body(0, make_standing_figure(), np.ones(J))
        rehearsal.perform([body], 0)
        rehearsal.cues([body])
        try:
            rehearsal.possess(body)
        except EnlivenError:  # Ignore the error here. It is reported when a performer attaches.
            return
        for i in range(3):
            moved_body = Body(0, body.joints + 0.01 * i, body.confidence * (1 - 0.1 * i))
            observed = ObservedPoints(moved_body.joints, np.tile([0.0, 0.0, 1.0], (J, 1)))
            rehearsal.perform([moved_body], (i + 1) * _STEP_NS, {0: observed})
            if rehearsal._solver is not None:
                rehearsal._solver.start_next_matrix()

    @property
    def _is_stationary(self) -> bool:
        """True if the mesh keeps its place and shape when a single performer attaches."""
        return self.settings.place == "fixed" or self.settings.how != "inside"

    def _display_placement(self, place: Placement) -> Placement:
        """Scales a placement from the mesh's own size to its display size."""
        return place.scale_about(self.growth, place.to_world(self._rules.stand))

    def _attachment_for_body(
        self, body: Body, parts: str, others: list[PerformerAttachment]
    ) -> TransformedAttachment:
        """Returns the attachment that the body would get now, in addition to those of the performers
        ``others``. It is empty if no node is within reach.
        """
        deformed = None
        if (self.holds or self._easing.is_active) and (others or self._is_stationary):
            deformed = self._is_shown_at_rest()
        earlier = [hold.attachments[0].rest_transform for hold in others]
        own_transform = next(
            (hold.attachments[0].rest_transform for hold in self.holds if hold.body == body.id), None
        )
        for rest_transform in self._rules.compute_rest_transforms(
            body, self._placement, earlier, own_transform
        ):
            grip = attach_within_reach(self.graph, self.settings, body, parts, rest_transform, deformed)
            if len(grip.attachment):
                break
        return grip

    def _is_shown_at_rest(self) -> tuple[Float, Float] | None:
        """Returns the displayed nodes, transformed to the rest space. Performers attach to the displayed
        mesh.
        """
        state = self._easing.shown
        return None if state is None else self._placement.state_to_rest(*state)

    def _replace_holds(self, holds: list[PerformerAttachment], start: tuple[Float, Float] | None) -> None:
        """Replaces the attached performers and the solver. The displayed state eases from the old to the new
        result."""
        self.holds = holds
        self._soft.reset_contacts()
        self._swing.restart()
        self._solver = EmbeddedSolver(
            self.graph, join_constraints(holds), self.settings.embedded, start, self._stiffness
        )
        self._easing.restart_fade()

    def _hand_over(self, bodies: list[Body], time_ns: int) -> None:
        """Transfers the attachment of a performer who is away longer than ``hand_over`` seconds to the idle
        performer in view, if there is exactly one.
        """
        patience, present = self.settings.hand_over, {body.id for body in bodies}
        absent_holds = [h for h in self.holds if h.body not in present and h.seconds_away(time_ns) > patience]
        idle = self._free_bodies(bodies)
        if patience > 0 and absent_holds and len(idle) == 1:
            self.hand_over(max(absent_holds, key=lambda h: h.seconds_away(time_ns)).body, idle[0])

    def _update_holds(self, bodies: list[Body], time_ns: int) -> None:
        """Updates the targets of all attached performers. A performer who is away does not drive the mesh,
        unless all attached performers are away.
        """
        present = {body.id: body for body in bodies}
        sunk = {h.body for h in self.holds if h.body in present and not h.is_credible(present[h.body])}
        if any(hold.body in present and hold.body not in sunk for hold in self.holds):
            present = {body_id: body for body_id, body in present.items() if body_id not in sunk}
        self._seen = any(hold.body in present for hold in self.holds)
        self._turned = 0.0
        for hold in self.holds if self._seen else []:
            is_lost = hold.seconds_away(time_ns) > self.settings.patience
            body = present.get(hold.body)
            if is_lost and (body is not None or hold.active):
                self._easing.restart_fade()
            hold.active = body is not None or not is_lost
            if body is not None:
                was_seen = hold.seen_ns == self._time_ns
                hold.update(body, time_ns)
                if was_seen and len(self.holds) == 1 and isinstance(hold.rest_transform, LimbRetargeting):
                    self._turned = hold.rest_transform.turned

    def _ease_into_pose(self, bodies: list[Body], time_ns: int) -> None:
        """Eases a mesh that no performer has been attached to yet into the pose of the performer who will
        attach next."""
        body = self.next_performer(bodies) if self._free and self._placed else None
        if body is None:
            return
        if self._approach is not None and self._approach.body == body.id:
            if self._approach.seconds_away(time_ns) > self.settings.patience:
                self._easing.restart_fade()
            return
        rest_transform = self._rules.approach_transform(body, self._placement)
        if rest_transform is not None:
            start = None if self._approach is None else self._approach.state
            fit = (body, rest_transform, self._stiffness, start)
            self._approach = PoseApproach(self.graph, self.settings, *fit)
            self._swing.restart()
            self._easing.restart_fade()

    def _solve_state(
        self, bodies: list[Body], seen: Mapping[int, ObservedPoints], time_ns: int
    ) -> tuple[Float, Float]:
        """Returns (N, 3, 3) linear parts and (N, 3) positions in the rest space. If no attached performer is
        in view, they are those of the last frame.
        """
        if self._approach is None and self._solver is None:
            return np.tile(np.eye(3), (len(self.graph.positions), 1, 1)), self.graph.positions
        floor = float(self._placement.to_rest(np.zeros(3))[1])
        if self._approach is not None:
            approach_body = next((body for body in bodies if body.id == self._approach.body), None)
            linear, positions = self._approach.advance(approach_body, time_ns)
        else:
            linear, positions = self._find_held_state(seen, floor, time_ns)
        return self._soft.lift_out_of_floor(linear, self._swing(positions, time_ns), floor)

    def _find_held_state(
        self, seen: Mapping[int, ObservedPoints], floor: float, time_ns: int
    ) -> tuple[Float, Float]:
        """Solves the state of the mesh that the attached performers deform."""
        assert self._solver is not None
        if not self._seen:
            return self._solver.state()
        hold_targets = [hold.targets for hold in self.holds]
        if self.settings.follow == "surface":
            unseen = [hold.body not in seen for hold in self.holds]
            hold_targets = [
                (node_numbers, pulls * fraction)
                for (node_numbers, pulls), fraction in zip(hold_targets, unseen, strict=True)
            ]
        targets, pulls = (np.concatenate(part) for part in zip(*hold_targets, strict=True))
        seconds = max(time_ns - self._time_ns, 0) * 1e-9
        planes = self._soft.planes(self._solver.state(), self.holds, seen, floor, seconds)
        return self._solver.solve(targets, pulls, planes=planes)
