"""Rigged characters on the stage: performers pose to choose a part, and move to animate that part."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.deformation.constraints.observed import ObservedPoints
from enliven.document import Pose, RiggedCharacter, Skeleton, character_of
from enliven.errors import InputError
from enliven.formats.gltf.read import read_gltf
from enliven.matching.body_limbs import limb_number
from enliven.matching.match_list import MatchList, MatchRow
from enliven.matching.views import ScreenView
from enliven.meshes import GLTF_SUFFIXES
from enliven.person import Body, parse_parts
from enliven.possession import Cues, Mode, make_cues
from enliven_edge.stage.actor import ChosenActor
from enliven_edge.stage.character_setup import make_character_id
from enliven_edge.stage.rig.chooser import Chooser
from enliven_edge.stage.rig.live_shape import Binding, LiveShape, Pair
from enliven_edge.stage.rig.settings import MatchingSettings


class RigActor(ChosenActor):
    """A character with its own skeleton.

    While a performer drives nothing yet, the performer chooses: in every frame all matches of the performer's
    limbs with the character are ranked, as seen by the viewer. Possessing the character accepts the shown
    match.
    """

    def __init__(self, shape: RiggedCharacter, settings: MatchingSettings | None = None) -> None:
        self.settings = settings or MatchingSettings()
        self.character = character_of(shape)
        self.live_shape = LiveShape(shape, self.settings.fade)
        self.chooser = Chooser(shape.skeleton, self.settings)
        self._placed = False
        self._time_ns = 0

    @property
    def skeleton(self) -> Skeleton:
        """The skeleton at rest. The joints of every pose have its order."""
        return self.live_shape.shape.skeleton

    @property
    def view(self) -> ScreenView:
        """Returns the viewer's direction of view."""
        return self.chooser.view

    @view.setter
    def view(self, view: ScreenView) -> None:
        self.chooser.view = view

    @property
    def holds(self) -> list[Binding]:  # type: ignore[override]
        """Returns the bindings that drive the character, the oldest first."""
        return self.live_shape.bindings

    @property
    def candidate(self) -> tuple[int | None, str]:
        """The performer who chooses now, otherwise the one of :meth:`preview`, and the name of the body
        parts.
        """
        candidate_id, parts = self._candidate
        return (self.chooser.body if self.chooser.body >= 0 else candidate_id), parts

    def perform(
        self, bodies: list[Body], time_ns: int, seen: Mapping[int, ObservedPoints] | None = None
    ) -> Pose:
        """Returns the pose at a time, and ranks the matches of a performer who drives nothing yet.

        Bodies with unknown joints are ignored. A performer who holds still accepts the shown match.
        """
        self._time_ns = time_ns
        bodies = [body for body in bodies if np.isfinite(body.joints).all()]
        if not self._placed and bodies:
            self._place_beside(bodies[0])
        if self.settings.hand_over > 0.0:
            self.live_shape.hand_over(bodies, self._free_bodies(bodies), time_ns, self.settings.hand_over)
        pose = self.live_shape.compute_pose(bodies, time_ns)
        self._choose(bodies)
        if self.chooser.pick.accepted:  # The performer has accepted the match by holding still.
            self._bind(bodies, "join")
        return pose

    def possess(self, body: Body, parts: str = "all", mode: Mode = "alone") -> None:
        """Lets the performer drive the shown match. The current pose becomes the rest pose.

        Raises:
            InputError: for an unknown part, or if the body or the character has no match.
        """
        parse_parts(parts)
        if not np.isfinite(body.joints).all():
            where, remedy = f"possessing {self.character.id!r}", "Step in front of the sensor again."
            raise InputError(f"the joints of performer {body.id} are not known", where=where, remedy=remedy)
        self._candidate = (body.id, parts)
        self._rank(body)
        self._bind([body], mode)

    def release(self, body: int | None = None) -> None:
        """Detaches one performer, or all performers if ``body`` is None. The choice of a match starts again.

        Raises:
            InputError: if that performer does not drive this character.
        """
        self._require_holder(body, ("drive", "driven"))
        self.live_shape.release(body)
        self.chooser.restart()

    def browse(self, step: int) -> None:
        """Shows the match that is ``step`` places further in the ranking. Step 0 makes it follow the pose
        again.
        """
        self.chooser.browse(step)

    def cues(self, bodies: list[Body]) -> Cues:
        """Returns the highlights of the driven joints. If there are none, highlights the joints of the shown
        match.
        """
        count = len(self.character.pivots)
        held = [(hold.body, _highlight_strengths(count, [t for _, t in hold.pairs])) for hold in self.holds]
        targets = () if held else self.chooser.targets()
        preview = (self.chooser.body, _highlight_strengths(count, targets)) if targets else None
        return make_cues(held, preview)

    def board(self) -> MatchList:
        """Returns the driven chains, the ranked matches of a performer who chooses, or an empty list."""
        own_id, chooser = self.character.id, self.chooser
        if self.holds:
            # While a performer drives the rig, another performer's match would hide the driven chains.
            rows = tuple(self._describe_driven(hold) for hold in self.holds)
            return MatchList(own_id, "playing", self.holds[0].body, self._time_ns, 0, rows, len(rows))
        rows, shown = chooser.rows(self.live_shape.joints)
        if shown < 0:
            return MatchList(own_id, "off", time_ns=self._time_ns)
        details = (chooser.body, self._time_ns, shown, rows, chooser.total, chooser.pick.held)
        return MatchList(own_id, "choosing", *details)

    def _describe_driven(self, hold: Binding) -> MatchRow:
        """Returns the chains that a performer drives, each with the limb that drives it."""
        lines = tuple(self.live_shape.joints[list(target)] for _, target in hold.pairs)
        limbs = tuple(limb_number(source) for source, _ in hold.pairs)
        return MatchRow("driven", 0, 0.0, lines, limbs, hold.body)

    def warm_up(self) -> None:
        """Runs all code paths with random joints on a copy, so that this character does not change."""
        rehearsal = RigActor(self.live_shape.shape, self.settings)
        joints = np.random.default_rng(0).normal(size=(20, 3))
        for parts in ("all", "arms"):
            body = Body(0, joints, np.ones(20))
            rehearsal.preview(0, parts)
            rehearsal.perform([body], 0)
            rehearsal.possess(body, parts)
            rehearsal.perform([body], 33_333_333)
            rehearsal.release()

    def _place_beside(self, body: Body) -> None:
        """Places the character next to the first performer, on the right side in the sensor's view."""
        self._placed = True
        low, high = self.character.vertices.min(0), self.character.vertices.max(0)
        across = body.joints[0, 0] + self.settings.beside + self.aside - low[0]
        self.live_shape.move_root(np.array([across, 0.0, body.joints[0, 2] - (low[2] + high[2]) / 2]))

    def _choose(self, bodies: list[Body]) -> None:
        """Ranks and picks matches for the requested performer, or for the first performer who drives
        nothing.
        """
        body = next((body for body in bodies if body.id == self._candidate[0]), None)
        if body is None or body.id in {hold.body for hold in self.holds}:
            body = self.next_performer(bodies)
        self._rank(body)

    def _rank(self, body: Body | None) -> None:
        self.chooser.rank(body, self._candidate[1], self.live_shape.joints, self._time_ns * 1e-9)

    def _bind(self, bodies: Sequence[Body], mode: Mode) -> None:
        """Binds the picked match to its performer."""
        pairs = self.chooser.accept()
        body = next((body for body in bodies if body.id == self.chooser.body), None)
        if not pairs or body is None:
            where = f"possessing {self.character.id!r}"
            raise InputError(
                "no part of the character is similar to the pose",
                where=where,
                remedy="Use a character with bones.",
            )
        if mode == "extend":
            pairs += self._keep_pairs(body.id, pairs)
        self.live_shape.bind(body, pairs, self.view, mirrored=self.settings.mirror, alone=mode == "alone")
        self.chooser.forget()

    def _keep_pairs(self, body: int, pairs: list[Pair]) -> list[Pair]:
        """Returns a performer's current pairs, without limbs that now drive another chain."""
        new_limbs = {source for source, _ in pairs}
        current_pairs = [pair for hold in self.holds if hold.body == body for pair in hold.pairs]
        return [pair for pair in current_pairs if pair[0] not in new_limbs]


def _highlight_strengths(count: int, chains: Sequence[Sequence[int]]) -> Float:
    """Returns (N,) weights: 1 for the bones of the chains, and 0 for the others."""
    strengths = np.zeros(count)
    for chain in chains:
        strengths[list(chain[1:])] = 1.0
    return strengths


log = logging.getLogger(__name__)


def create_rig_actor(spec: str, settings: MatchingSettings | None = None, name: str = "") -> RigActor:
    """Returns the actor of a rigged glTF model, on the floor and scaled to the settings' height.

    Args:
        name: the character's id. If empty, the file's stem is used.

    Raises:
        InputError: for a file that is not glTF, or cannot be used.
    """
    settings = settings or MatchingSettings()
    if Path(spec).suffix.lower() not in GLTF_SUFFIXES:
        remedy = "Use a rigged .glb, .gltf or .vrm file, or drive the mesh by a graph (--drive graph)."
        raise InputError("the file has no skeleton", where=spec, remedy=remedy)
    rig = read_gltf(
        Path(spec), name=name or make_character_id(spec), height=settings.height or None, floor=True
    )
    for note in rig.notes:
        log.info("%s: %s", spec, note)
    return RigActor(rig.shape, settings)
