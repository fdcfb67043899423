"""A shape that performers drive live: takes that are fed frame by frame, bound to its chains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Pose, Project, Shape
from enliven.matching import ScreenView
from enliven.motion.layers import Player, bind_chain, pose_from
from enliven.person import PARENTS, Body
from enliven.rotation import conjugate, multiply
from enliven.takes import clip_of_bodies, turns_of
from enliven_edge.stage.easing import Fading

_TOWARDS = np.array([0.0, 0.0, -1.0])
"""Where a sensor looks, in a world whose performers face +Z."""

Pair = tuple[tuple[int, ...], tuple[int, ...]]
"""A chain of the body, and the chain of the shape that it drives."""


@dataclass
class Binding:
    """A performer who drives chains of the shape.

    Attributes:
        body: the performer's id.
        pairs: what drives what.
        take: one frame, the pose at which it began: the rest pose of what follows.
        view: from where the shape was seen then.
        mirrored: as in a mirror.
        still: the performer then.
        joints: (20, 3) metres, where the performer's joints were last.
        turns: (20, 4) what they were turned by then, or None.
        seen_ns: when that was, the sensor's clock.
        trust: (20,) how far each joint is followed, 0..1.
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

    def see(self, body: Body, time_ns: int, ease: float) -> None:
        """Turns bones as far as the body's are turned since the binding began.

        A joint that is not seen is a guess and must not pull: its bone keeps its direction. When it is seen
        again, the bone eases to where it is.

        Args:
            ease: seconds that this takes.
        """
        seconds = max(time_ns - self.seen_ns, 0) * 1e-9
        gain = seconds / ease if ease > 0.0 else 1.0
        self.trust = np.where(body.confidence > 0, np.minimum(self.trust + gain, 1.0), 0.0)
        before = self.joints.copy()
        for joint, parent in enumerate(PARENTS):
            if parent < 0:
                self.joints[joint] += self.trust[joint] * (body.joints[joint] - before[joint])
                continue
            kept, seen = before[joint] - before[parent], body.joints[joint] - body.joints[parent]
            self.joints[joint] = self.joints[parent] + kept + self.trust[joint] * (seen - kept)
        known: Float | None = None
        if self.still.orientations is not None and body.orientations is not None:
            known = multiply(body.orientations, conjugate(self.still.orientations))[None]
        self.turns = turns_of(self.take.skeleton, self.joints[None], known)[0]
        self.seen_ns = time_ns


class Puppet:
    """A shape, who drives it, and its pose; what changes eases over.

    Args:
        shape: at rest.
        fade: seconds that a change takes to show.
    """

    def __init__(self, shape: Shape, fade: float) -> None:
        self.shape, self.bindings = shape, list[Binding]()
        self._fading, self._fade = Fading(fade), fade
        self._count, self._time_ns = 0, 0
        self._rebuild()
        self.joints: Float = self._player.at(0.0).joints

    def stand(self, place: Float) -> None:
        """Puts the root ``place`` (3,) metres from where it was modelled."""
        self.shape = self.shape.with_changes(place=place)
        self._rebuild()
        self.joints = self._player.at(0.0).joints

    def bind(
        self, body: Body, pairs: Sequence[Pair], view: ScreenView, *, mirrored: bool, alone: bool = False
    ) -> None:
        """From now on, chains of the body drive chains of the shape; both are at rest as they are now.

        Args:
            alone: takes everybody else off; else only what this performer drove before.
        """
        self._count += 1
        take = clip_of_bodies([body], np.zeros(1), f"live {self._count}")
        self.bindings = [b for b in self.bindings if not alone and b.body != body.id]
        joints = np.array(body.joints, np.float64)
        made = Binding(body.id, tuple(pairs), take, view, mirrored, body, joints, seen_ns=self._time_ns)
        self.bindings.append(made)
        self._rebuild()
        self._fading.tear()

    def release(self, body: int | None = None) -> None:
        """A performer, or everybody, lets go; the shape eases back to rest."""
        self.bindings = [b for b in self.bindings if body is not None and b.body != body]
        self._rebuild()
        self._fading.tear()

    def hand_over(self, bodies: Sequence[Body], time_ns: int, patience: float) -> None:
        """Who alone drives nothing goes on for who has been away for longer than some seconds."""
        present = {body.id for body in bodies}
        away = [b for b in self.bindings if b.body not in present and time_ns - b.seen_ns > patience * 1e9]
        idle = present - {binding.body for binding in self.bindings}
        if away and len(idle) == 1:
            min(away, key=lambda binding: binding.seen_ns).body = idle.pop()
            self._fading.tear()

    def pose(self, bodies: Sequence[Body], time_ns: int) -> Pose:
        """The pose at a moment; of performers who are out of view, the last."""
        present = {body.id: body for body in bodies}
        for binding in self.bindings:
            body = present.get(binding.body)
            if body is not None:
                binding.see(body, time_ns, self._fade)
            if binding.turns is not None:
                self._player.feed(binding.take.id, binding.turns, binding.joints[0])
        self._time_ns = time_ns
        at = self._player.at(time_ns * 1e-9)
        self.joints = at.joints
        pose = pose_from(self.shape, at, time_ns * 1e-9)
        linear, positions = self._fading(
            pose.linear.astype(np.float64), pose.positions.astype(np.float64), time_ns
        )
        return Pose(self.shape.id, time_ns, linear.astype(np.float32), positions.astype(np.float32))

    def _rebuild(self) -> None:
        """The project of what is bound, and its player."""
        project = Project().with_shapes(self.shape)
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
                    source_view=_TOWARDS if binding.mirrored else -_TOWARDS,
                    source_up=np.array([0.0, 1.0, 0.0]),
                    mirrored=binding.mirrored,
                )
        self._player = Player(project, self.shape.id)
