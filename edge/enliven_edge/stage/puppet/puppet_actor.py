"""Puppets on the stage: key poses map the performers' joints to the control points of a mesh."""

from __future__ import annotations

import cmath
from collections.abc import Mapping

import numpy as np

from enliven.arrays import Float
from enliven.deformation.constraints.observed import ObservedPoints
from enliven.document import ExampleCharacter, Pose, Project, character_from_puppet
from enliven.errors import InputError
from enliven.examples.mapping import ExampleMap
from enliven.examples.puppet_examples import examples_from_key_poses, reference_performer
from enliven.examples.puppet_motion import PuppetState, pose_of_state
from enliven.examples.travel import find_travel
from enliven.person import MIRROR, Body, parse_parts
from enliven.possession import Actor, Cues, Mode, PoseBlend, make_cues
from enliven.rotation import rotate
from enliven_edge.stage.puppet.bones import BoneTracker
from enliven_edge.stage.puppet.hold import ControlPointHold
from enliven_edge.stage.puppet.live_puppet import LivePuppet, PerformerInput
from enliven_edge.stage.puppet.locomotion import FootDetector, Locomotion, side_of_foot
from enliven_edge.stage.puppet.retargeting import Retargeting
from enliven_edge.stage.puppet.settings import PuppetSettings

_VISIBLE_EASE_S = 0.4
"""Seconds until a joint that is visible again has its full weight."""
_MAX_FRAME_GAP_S = 0.3
"""Gap between frames, in seconds, after which the motion restarts with a blend."""
_FRAME_NS = 33_333_333
"""Nanoseconds between the frames of a rehearsal that compiles and loads the code in advance."""


class PuppetActor(Actor):
    """A mesh with control points and key poses.

    Args:
        project: the project with the puppet and the takes of its key poses.

    Raises:
        InputError: if the puppet is incomplete, or follows joints that a tracked person does not have.
    """

    def __init__(
        self, project: Project, puppet: ExampleCharacter, settings: PuppetSettings | None = None
    ) -> None:
        self.settings = settings or PuppetSettings()
        self._project, self._puppet = project, puppet
        self._examples = examples_from_key_poses(project, puppet)
        self._retargeting = Retargeting(reference_performer(project, puppet), self._examples.joints)
        self.character = character_from_puppet(puppet)
        self.holds: list[ControlPointHold] = []
        can_walk = self.settings.place == "walks"
        feet = [k for k, point in enumerate(puppet.points) if point.foot]
        sides = [side_of_foot(self._retargeting.joints[k]) for k in feet]
        self._travel = find_travel(project, puppet)
        how = (1.0 / self.settings.rate, puppet.locomotion, sides, self._travel if can_walk else None)
        locomotion = Locomotion(puppet.rest, feet, *how)
        mapping = ExampleMap(self._examples, puppet.examples)
        self._locomotion = locomotion
        self._live = LivePuppet(mapping, locomotion, self.settings.rate, self.settings.lag)
        self._live.rest = puppet.rest
        self._state = PuppetState(puppet.rest.copy(), 0.0, np.zeros(3))
        self._easing = PoseBlend(self.settings.fade, self.settings.fade_pace)
        self._lead: ControlPointHold | None = None
        self._yaw_offset = 0.0
        self._restarts = self._placed = False
        self._time_ns = 0

    def perform(
        self, bodies: list[Body], time_ns: int, seen: Mapping[int, ObservedPoints] | None = None
    ) -> Pose:
        """Returns the pose to which the key poses map the performers' joints.

        Places the puppet next to the first visible performer once. Eases changes of performers, and gaps
        between frames.
        """
        if not self._placed and bodies and np.isfinite(bodies[0].joints).all():
            self._place_beside(bodies[0])
        self._hand_over(bodies, time_ns)
        paused = not 0 < time_ns - self._time_ns <= _MAX_FRAME_GAP_S * 1e9
        if paused:
            self._easing.skip(time_ns)
        self._update_holds(bodies, time_ns)
        if self.holds:
            self._update_state(time_ns, paused)
        self._time_ns = time_ns
        pose = pose_of_state(self._puppet, self._state, time_ns)
        linear, positions = self._easing(
            pose.linear.astype(np.float64), pose.positions.astype(np.float64), time_ns
        )
        return Pose(self.character.id, time_ns, linear.astype(np.float32), positions.astype(np.float32))

    def possess(self, body: Body, parts: str = "all", mode: Mode = "alone") -> None:
        """Lets the performer move the control points that are paired with these parts of the body.

        Args:
            mode: "alone" ends all other holds. With "join" the other performers keep the points that this
                performer does not take, and this performer's earlier points are released. "extend" keeps the
                earlier points, too.

        Raises:
            InputError: for an unknown part, or one without a paired control point.
        """
        points = self._find_paired_points(parts)
        if not points:
            raise InputError(
                f"no control point of the puppet follows the body parts {parts!r}",
                where=f"possessing {self.character.id!r}",
                remedy=f"The control points follow these joints: {', '.join(self._list_followed_names())}.",
            )
        if not ((body.confidence > 0) & np.isfinite(body.joints).all(1)).any():
            where, remedy = f"possessing {self.character.id!r}", "Step in front of the sensor again."
            raise InputError(f"no joint of performer {body.id} is visible", where=where, remedy=remedy)
        own_hold = next((hold for hold in self.holds if hold.body == body.id), None)
        if own_hold is not None and mode == "extend":
            points |= own_hold.points
        hold = own_hold or self._create_hold(body.id, points)
        hold.points = points
        hold.update(body, self._retargeting, self._time_ns, mirror=self.settings.mirror)
        others = [] if mode == "alone" else [other for other in self.holds if other is not hold]
        for other in others:
            other.points -= points
        self._replace_holds([*(other for other in others if other.points), hold])
        self._candidate = (None, parts)

    def release(self, body: int | None = None) -> None:
        """Detaches one performer, or all performers if ``body`` is None. The control points ease back to
        rest.

        Raises:
            InputError: if that performer does not move this puppet.
        """
        self._require_holder(body, ("move", "moved"))
        left = [hold for hold in self.holds if body is not None and hold.body != body]
        self._replace_holds(left)

    def cues(self, bodies: list[Body]) -> Cues:
        """Returns the highlights of the moved control points, and of the points that the next performer would
        move.
        """
        who, parts = self._candidate
        body = next((b for b in bodies if b.id == who), None) or self.next_performer(bodies)
        held = [(hold.body, self._highlight_strengths(hold.points)) for hold in self.holds]
        preview = (
            None if body is None else (body.id, self._highlight_strengths(self._find_paired_points(parts)))
        )
        return make_cues(held, preview)

    def warm_up(self) -> None:
        """Runs all code paths with random joints on a copy, so that this puppet does not change."""
        rehearsal = PuppetActor(self._project, self._puppet, self.settings)
        joints = np.random.default_rng(0).normal(size=(20, 3))
        body = Body(0, joints, np.ones(20))
        for frame in range(6):
            rehearsal.perform([body], frame * _FRAME_NS)
            if frame == 1:
                rehearsal.possess(body)

    def _create_hold(self, body: int, points: frozenset[int]) -> ControlPointHold:
        settings = self._puppet.locomotion
        feet = FootDetector(settings.contact, settings.runner)
        return ControlPointHold(body, points, BoneTracker(_VISIBLE_EASE_S), feet, seen_ns=self._time_ns)

    def _find_paired_points(self, parts: str) -> frozenset[int]:
        """Returns the control points that are paired with the given parts of the performer's body."""
        joints = {int(joint) for joint in parse_parts(parts)}
        if self.settings.mirror:
            joints = {MIRROR[joint] for joint in joints}
        return frozenset(k for k, joint in enumerate(self._retargeting.joints) if int(joint) in joints)

    def _list_followed_names(self) -> list[str]:
        """Returns the names of the joints that control points are paired with."""
        return sorted({joint.name.lower().replace("_", " ") for joint in self._retargeting.joints})

    def _highlight_strengths(self, points: frozenset[int]) -> Float:
        """Returns (P + 1,) weights: 1 for the transforms of these control points, and 0 for the others."""
        strengths = np.zeros(len(self._puppet.points) + 1)
        strengths[[1 + point for point in points]] = 1.0
        return strengths

    def _replace_holds(self, holds: list[ControlPointHold]) -> None:
        """Replaces the holds. The shown state eases to the new one."""
        self.holds = holds
        held = frozenset[int]().union(*(hold.points for hold in holds))
        count = len(self._puppet.points)
        self._live.free_points = np.array([k for k in range(count) if k not in held], np.int64)
        self._restarts = True
        self._easing.restart_fade()
        if not holds:
            self._lead = None
            self._rest()

    def _rest(self) -> None:
        rest_state = PuppetState(self._puppet.rest.copy(), self._state.yaw, np.zeros(3))
        if self._locomotion.can_step:
            offset = self._locomotion.compute_feet_centre(self._state) - self._locomotion.compute_feet_centre(
                rest_state
            )
            rest_state = PuppetState(rest_state.places, rest_state.yaw, offset * np.array([1.0, 0.0, 1.0]))
        self._state = rest_state

    def _update_holds(self, bodies: list[Body], time_ns: int) -> None:
        """Updates all holds from the bodies in view. A performer who returns is blended in."""
        present = {body.id: body for body in bodies}
        for hold in self.holds:
            body = present.get(hold.body)
            if body is None:
                continue
            if hold.seconds_away(time_ns) > _MAX_FRAME_GAP_S:
                self._restarts = True
            hold.update(body, self._retargeting, time_ns, mirror=self.settings.mirror)

    def _update_state(self, time_ns: int, paused: bool) -> None:
        """Updates the state from the holds' last poses."""
        lead = self._find_leading_hold()
        if lead is not self._lead:
            self._lead, self._yaw_offset = lead, self._state.yaw - lead.yaw
        pose = lead.pose.copy()
        for hold in self.holds:
            rows = list(hold.points)
            pose[rows] = hold.pose[rows]
        yaw = self._yaw_offset + lead.yaw if self._locomotion.can_step else 0.0
        size = self.settings.jump * float(np.ptp(self._puppet.mesh.vertices[:, 1]))
        path = self._travel.stride * lead.path_position * cmath.exp(-1j * self._yaw_offset)
        sample = PerformerInput(pose, yaw, lead.footing, size, path)
        if self._restarts or paused:
            self._restarts = False
            self._easing.restart_fade()
            self._state = self._live.begin(time_ns, sample, self._state)
        else:
            self._state = self._live.advance(time_ns, sample)

    def _find_leading_hold(self) -> ControlPointHold:
        """Returns the hold that moves the puppet through the world.

        It is the oldest hold with a foot, or else the oldest hold.
        """
        feet = {k for k, point in enumerate(self._puppet.points) if point.foot}
        return next((hold for hold in self.holds if hold.points & feet), self.holds[0])

    def _hand_over(self, bodies: list[Body], time_ns: int) -> None:
        """Transfers the hold of a performer who has been out of view for long to the only idle performer in
        view.
        """
        patience, present = self.settings.hand_over, {body.id for body in bodies}
        away = [h for h in self.holds if h.body not in present and h.seconds_away(time_ns) > patience]
        idle = self._free_bodies(bodies)
        if patience > 0 and away and len(idle) == 1:
            old = max(away, key=lambda hold: hold.seconds_away(time_ns))
            new = self._create_hold(idle[0].id, old.points)
            new.update(idle[0], self._retargeting, time_ns, mirror=self.settings.mirror)
            self._replace_holds([new if hold is old else hold for hold in self.holds])

    def _place_beside(self, body: Body) -> None:
        """Places the puppet next to the first performer, on the right side in the sensor's view."""
        self._placed = True
        if not self.settings.meet:
            return
        turned_vertices = rotate(self._puppet.turn, self._puppet.mesh.vertices)
        low, high = turned_vertices.min(0), turned_vertices.max(0)
        across = body.joints[0, 0] + self.settings.beside + self.aside - low[0]
        along = body.joints[0, 2] - (low[2] + high[2]) / 2
        place = np.array([across, self._puppet.place[1], along])
        self._puppet = self._puppet.with_changes(place=place)
