"""One character on the stage: free, or possessed by a body, and never jumping between the two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from enliven.arrays import Float, Int
from enliven.body import Body, parts_named
from enliven.character import Character, Pose
from enliven.deformation.attachment import Attachment, AttachmentSettings, attach
from enliven.deformation.embedded import EmbeddedSettings, EmbeddedSolver
from enliven.deformation.graph import DeformationGraph
from enliven.errors import InputError
from enliven.settings import setting
from enliven_edge.placement import AS_MODELLED, Placement, meeting

State = Literal["free", "possessed"]
_AWAY = 0.2
"""Seconds; a performer who was away for longer is not where they were."""


@dataclass(frozen=True)
class ActorSettings:
    """How a character meets its performer."""

    place: Literal["meet", "fixed"] = setting(
        "meet", "'meet' puts the mesh where the performer stands, 'fixed' leaves it as modelled."
    )
    height_ratio: float = setting(1.0, "The mesh's height over the performer's.", low=0.05, high=20.0)
    fade: float = setting(0.5, "Time to ease between free and possessed.", unit="s", low=0.0, high=10.0)
    hand_over: float = setting(
        60.0,
        "Another performer, alone in view, goes on after this; 0: only who takes hold.",
        unit="s",
        low=0.0,
    )
    enough: float = setting(
        0.5, "Share of the bones that must take hold before the reach stops growing.", low=0.0
    )
    farthest_reach: float = setting(0.45, "Longest reach that is tried.", unit="m", low=0.0, high=5.0)
    attachment: AttachmentSettings = setting(AttachmentSettings, "How bones take hold.")
    embedded: EmbeddedSettings = setting(EmbeddedSettings, "The deformation's weights.")


@dataclass(frozen=True)
class Cues:
    """What the viewer highlights: the nodes that are held, or would be.

    Attributes:
        state: "free" shows what would be held now.
        nodes: (K,) node indices.
        strengths: (K,) in (0, 1].
        body: the id of the performer, -1 for nobody.
    """

    state: State
    nodes: Int
    strengths: Float
    body: int


class Actor:
    """A character, the graph that deforms it, and who holds it.

    Everything is solved in the rest space of the mesh; the placement carries it into the world.
    """

    def __init__(
        self, character: Character, graph: DeformationGraph, settings: ActorSettings | None = None
    ) -> None:
        self.character, self.graph = character, graph
        self.settings = settings or ActorSettings()
        self.state: State = "free"
        self.body_id = -1
        self._height = float(np.ptp(character.vertices[:, 1])) or 1.0
        self._placement: Placement = AS_MODELLED
        self._met = self.settings.place == "fixed"
        self._attachment: Attachment | None = None
        self._solver: EmbeddedSolver | None = None
        self._parts = "all"
        self._pulls: Float | None = None
        self._shown: Pose = character.rest_pose()
        self._fade_from: Pose | None = None
        self._fade_start_ns = 0
        self._held_ns: int | None = None

    def possess(self, body: Body, parts: str = "all") -> None:
        """The body takes hold of the mesh where both are now; a hold that was there is let go.

        Raises:
            InputError: for an unknown part, or where nothing of the mesh can be reached; the actor stays as
                it was.
        """
        placement = self._placement
        if self.settings.place == "meet":
            placement = meeting(body, self._height, self.settings.height_ratio)
        held = self._hold(body, placement, parts)
        if not len(held):
            raise InputError(
                f"no part of the mesh is within {self.settings.farthest_reach} m of the body",
                where=f"possessing {self.character.id!r} with {parts}",
                mend="Step into the mesh, or set place = 'meet'.",
            )
        self._begin_fade()
        self._placement, self._attachment, self._parts = placement, held, parts
        self._solver = EmbeddedSolver(self.graph, held, self.settings.embedded)
        self._pulls = None
        self._met, self.state, self.body_id, self._held_ns = True, "possessed", body.id, None

    def release(self) -> None:
        """The body lets go; the mesh eases back to its rest shape where it is."""
        if self.state == "free":
            return
        self._begin_fade()
        moved = self._shown.positions - self._placement.to_world(self.graph.positions)
        offset = self._placement.offset + np.array([moved[:, 0].mean(), 0.0, moved[:, 2].mean()])
        self._placement = Placement(self._placement.scale, self._placement.yaw, offset)
        self._attachment = self._solver = None
        self.state, self.body_id = "free", -1

    def perform(self, bodies: list[Body], time_ns: int) -> Pose:
        """The pose at a moment: of the possession, or of the mesh waiting where it stands."""
        body = self._performer(bodies, time_ns)
        if self.state == "free":
            self._meet(bodies)
        linear, positions = self._solved(body)
        world = self._placement
        pose = Pose(
            self.character.id,
            time_ns,
            (world.scale * world.rotation @ linear).astype(np.float32),
            world.to_world(positions).astype(np.float32),
        )
        self._shown = self._faded(pose, time_ns)
        return self._shown

    def cues(self, bodies: list[Body]) -> Cues:
        """What is held, or would be held if the first body took hold now."""
        if self._attachment is not None:
            return Cues("possessed", *self._attachment.nodes, self.body_id)
        if not bodies or not self._met:
            return Cues("free", np.empty(0, np.int64), np.empty(0), -1)
        joints = self._placement.to_rest(bodies[0].joints)
        held = attach(self.graph, joints, bodies[0].confidence, self._parts, self.settings.attachment)
        return Cues("free", *held.nodes, bodies[0].id)

    def _hold(self, body: Body, placement: Placement, parts: str) -> Attachment:
        """The attachment at the settings' reach, or farther where too few of the bones reach anything."""
        joints = placement.to_rest(body.joints)
        bones = self.settings.enough * sum(1 for j in parts_named(parts) if body.confidence[j] > 0)
        reach = self.settings.attachment.reach
        while True:
            values = {**vars(self.settings.attachment), "reach": reach}
            held = attach(self.graph, joints, body.confidence, parts, AttachmentSettings(**values))
            if (
                len(np.unique(held.bone)) >= self.settings.enough * bones
                or reach >= self.settings.farthest_reach
            ):
                return held
            reach = min(1.5 * reach + 0.01, self.settings.farthest_reach)

    def _meet(self, bodies: list[Body]) -> None:
        """Puts the mesh where the first performer was first seen, as tall as they are."""
        if not self._met and bodies:
            self._placement = meeting(bodies[0], self._height, self.settings.height_ratio)
            self._met = True

    def _performer(self, bodies: list[Body], time_ns: int) -> Body | None:
        """The body that holds the mesh, and nobody else's; but long after it left, who is there alone."""
        if self.state == "free":
            return None
        found = next((body for body in bodies if body.id == self.body_id), None)
        left = 0.0 if self._held_ns is None else (time_ns - self._held_ns) * 1e-9
        patience = self.settings.hand_over
        if found is None and len(bodies) == 1 and patience > 0 and not 0.0 <= left <= patience:
            found = bodies[0]
            self.body_id = found.id
        if self._held_ns is None or found is not None:
            if left > _AWAY:
                self._begin_fade()
            self._held_ns = time_ns
        return found

    def _solved(self, body: Body | None) -> tuple[Float, Float]:
        """The graph's linear parts and positions in the rest space; as they were where the body is lost."""
        if self._solver is None or self._attachment is None:
            count = len(self.graph.positions)
            return np.tile(np.eye(3), (count, 1, 1)), self.graph.positions
        if body is None:
            return self._solver.state()
        pulls = self._attachment.target_weights(body.confidence)
        # Confidence flickers from frame to frame; a constraint that came and went with it would shake.
        self._pulls = pulls if self._pulls is None else self._pulls + 0.25 * (pulls - self._pulls)
        targets = self._attachment.targets(self._placement.to_rest(body.joints))
        return self._solver.solve(targets, self._pulls)

    def _begin_fade(self) -> None:
        """What is shown from now on eases away from what is shown now."""
        self._fade_from, self._fade_start_ns = self._shown, self._shown.time_ns

    def _faded(self, pose: Pose, time_ns: int) -> Pose:
        """The pose, or its mixture with the one that the fade began from."""
        if self._fade_from is None:
            return pose
        share = (time_ns - self._fade_start_ns) * 1e-9 / max(self.settings.fade, 1e-9)
        if not 0.0 <= share < 1.0:
            self._fade_from = None
            return pose
        share = share * share * (3 - 2 * share)
        before = self._fade_from
        linear = before.linear + np.float32(share) * (pose.linear - before.linear)
        positions = before.positions + np.float32(share) * (pose.positions - before.positions)
        return Pose(pose.character, time_ns, linear, positions)
