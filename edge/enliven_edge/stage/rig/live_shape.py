"""A rigged character that performers drive live.

Takes are extended frame by frame, and bound to chains of the character.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Pose, Project, RiggedCharacter
from enliven.matching.views import ScreenView
from enliven.motion.layers.evaluate import Player, pose_from
from enliven.motion.layers.retarget import bind_chain
from enliven.motion_clips.joint_positions import clip_of_bodies, rotations_from_positions
from enliven.person import PARENTS, Body
from enliven.possession import PoseBlend
from enliven.rotation import conjugate, multiply

_VIEW_DIRECTION = np.array([0.0, 0.0, -1.0])
"""(3,) unit direction of the sensor's view in the world, because performers face +Z."""
Pair = tuple[tuple[int, ...], tuple[int, ...]]
"""A chain of the body, and the chain of the character that it drives."""


@dataclass
class Binding:
    """A performer who drives chains of the character.

    Attributes:
        body: the performer's id.
        pairs: the chains of the body, each with the chain that it drives.
        take: a take of one frame, the pose at the start of the binding. It is the rest pose.
        view: the viewer's direction of view at the start.
        mirrored: whether the character moves as in a mirror.
        still: the body of the performer at the start.
        joints: (20, 3) metres, the performer's last joints.
        turns: (20, 4) rotations of the joints since the start, as quaternions, or None.
        seen_ns: nanoseconds of the sensor's clock when the performer was last in view.
        trust: (20,) weight in [0, 1] with which each joint is followed.
    """

    body: int
    pairs: tuple[Pair, ...]
    take: Clip
    view: ScreenView
    mirrored: bool
    still: Body
    joints: Float
    turns: Float | None = None
    seen_ns: int = 0
    trust: Float = field(default_factory=lambda: np.ones(len(PARENTS)))

    def update(self, body: Body, time_ns: int, ease: float) -> None:
        """Updates the rotations of the bones since the start of the binding.

        The position of a joint that is not visible is a guess, so its bone keeps its direction. When the
        joint becomes visible again, the bone eases towards it.

        Args:
            ease: duration of this easing in seconds.
        """
        seconds = max(time_ns - self.seen_ns, 0) * 1e-9
        gain = seconds / ease if ease > 0.0 else 1.0
        self.trust = np.where(body.confidence > 0, np.minimum(self.trust + gain, 1.0), 0.0)
        old_joints = self.joints.copy()
        for joint, parent in enumerate(PARENTS):
            if parent < 0:
                self.joints[joint] += self.trust[joint] * (body.joints[joint] - old_joints[joint])
                continue
            old_bone, new_bone = (
                old_joints[joint] - old_joints[parent],
                body.joints[joint] - body.joints[parent],
            )
            self.joints[joint] = self.joints[parent] + old_bone + self.trust[joint] * (new_bone - old_bone)
        rotations: Float | None = None
        if self.still.orientations is not None and body.orientations is not None:
            rotations = multiply(body.orientations, conjugate(self.still.orientations))[None]
        self.turns = rotations_from_positions(self.take.skeleton, self.joints[None], rotations)[0]
        self.seen_ns = time_ns


class LiveShape:
    """A rigged character, the bindings that drive it, and its pose. Changes of bindings are blended.

    Args:
        shape: the character at rest.
        fade: seconds of the blend.
    """

    def __init__(self, shape: RiggedCharacter, fade: float) -> None:
        self.shape, self.bindings = shape, list[Binding]()
        self._easing, self._fade = PoseBlend(fade), fade
        self._count, self._time_ns = 0, 0
        self._rebuild_player()
        self.joints: Float = self._player.compute_pose(0.0).joints

    def move_root(self, place: Float) -> None:
        """Moves the root to ``place`` (3,), metres from its modelled position."""
        self.shape = self.shape.with_changes(place=place)
        self._rebuild_player()
        self.joints = self._player.compute_pose(0.0).joints

    def bind(
        self, body: Body, pairs: Sequence[Pair], view: ScreenView, *, mirrored: bool, alone: bool = False
    ) -> None:
        """Binds chains of the body to chains of the character. The current poses of the body and the
        character become the rest poses.

        Args:
            alone: whether to end all other bindings. If False, only this performer's earlier binding ends.
        """
        self._count += 1
        take = clip_of_bodies([body], np.zeros(1), f"live {self._count}")
        self.bindings = [b for b in self.bindings if not alone and b.body != body.id]
        joints = np.array(body.joints, np.float64)
        binding = Binding(body.id, tuple(pairs), take, view, mirrored, body, joints, seen_ns=self._time_ns)
        self.bindings.append(binding)
        self._rebuild_player()
        self._easing.restart_fade()

    def release(self, body: int | None = None) -> None:
        """Ends the binding of one performer, or of all. A free character moves smoothly back to its rest
        pose.
        """
        self.bindings = [b for b in self.bindings if body is not None and b.body != body]
        self._rebuild_player()
        self._easing.restart_fade()

    def hand_over(self, bodies: Sequence[Body], idle: Sequence[Body], time_ns: int, patience: float) -> None:
        """Transfers the binding of an absent performer to the only idle performer.

        The performer must be away for more than ``patience`` seconds.
        """
        present = {body.id for body in bodies}
        away = [b for b in self.bindings if b.body not in present and time_ns - b.seen_ns > patience * 1e9]
        if away and len(idle) == 1:
            min(away, key=lambda binding: binding.seen_ns).body = idle[0].id
            self._easing.restart_fade()

    def compute_pose(self, bodies: Sequence[Body], time_ns: int) -> Pose:
        """Returns the pose at a moment. Performers out of view keep their last pose."""
        present = {body.id: body for body in bodies}
        for binding in self.bindings:
            body = present.get(binding.body)
            if body is not None:
                binding.update(body, time_ns, self._fade)
            if binding.turns is not None:
                self._player.feed(binding.take.id, binding.turns, binding.joints[0])
        self._time_ns = time_ns
        shape_pose = self._player.compute_pose(time_ns * 1e-9)
        self.joints = shape_pose.joints
        pose = pose_from(self.shape, shape_pose, time_ns * 1e-9)
        linear, positions = self._easing(
            pose.linear.astype(np.float64), pose.positions.astype(np.float64), time_ns
        )
        return Pose(self.shape.id, time_ns, linear.astype(np.float32), positions.astype(np.float32))

    def _rebuild_player(self) -> None:
        """Builds the project of all bindings, and its player."""
        project = Project().with_characters(self.shape)
        for binding in self.bindings:
            project = project.with_takes(binding.take)
            for source, target in binding.pairs:
                project = bind_chain(
                    project,
                    self.shape.id,
                    target,
                    binding.take.id,
                    source,
                    view=binding.view.direction,
                    up=binding.view.up,
                    source_view=_VIEW_DIRECTION if binding.mirrored else -_VIEW_DIRECTION,
                    source_up=np.array([0.0, 1.0, 0.0]),
                    mirrored=binding.mirrored,
                )
        self._player = Player(project, self.shape.id)
