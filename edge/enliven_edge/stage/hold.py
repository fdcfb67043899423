"""One performer's hold on a mesh: what of the body holds what of the mesh, and how firmly just now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from enliven.arrays import Float, Int32
from enliven.deformation.possession import Attachment
from enliven.person import Body
from enliven_edge.stage.carrying import Carrying

_SETTLING = 0.12
"""Seconds in which most of a change of confidence takes effect: it flickers, and the mesh would shake."""

_FARTHEST = 1e4
"""Metres; a target farther away than this is no measurement."""

_SUNK = 0.06
"""Metres; whose lowest joint is so much deeper in the floor than when they took hold is not where they are
said to be: skeletons of somebody who is half hidden drop through the floor before they are gone."""


@dataclass
class Grip:
    """An attachment, and how joints come to it; a performer who takes hold again has several.

    Attributes:
        attachment: the points that the body drives.
        carrying: from the world into the rest space.
        parts: what of the body took hold.
    """

    attachment: Attachment
    carrying: Carrying
    parts: str


@dataclass
class Hold:
    """What one performer holds.

    Attributes:
        body: the performer's id.
        grips: everything that they hold.
        seen_ns: when they were last in view, the sensor's clock; None before the first frame.
        active: whether they count just now.
        depth: metres by which they stood in the floor when they took hold: it may not be quite where it is.
    """

    body: int
    grips: list[Grip]
    seen_ns: int | None = None
    active: bool = True
    depth: float = 0.0
    _targets: Float | None = field(default=None, repr=False)
    _pulls: Float | None = field(default=None, repr=False)

    @property
    def carrying(self) -> Carrying:
        """How the performer's surface comes into the rest space: as with the last grip."""
        return self.grips[-1].carrying

    def __len__(self) -> int:
        return sum(len(grip.attachment) for grip in self.grips)

    def away(self, time_ns: int) -> float:
        """Seconds since the performer was last in view; to it, where the clock went back."""
        return 0.0 if self.seen_ns is None else abs(time_ns - self.seen_ns) * 1e-9

    def with_grip(self, grip: Grip) -> Hold:
        """The same hold with another grip; bones that hold by it hold by nothing else."""
        anew = np.unique(grip.attachment.bone)
        grips = [
            replace(g, attachment=g.attachment.only(~np.isin(g.attachment.bone, anew))) for g in self.grips
        ]
        grips = [g for g in grips if len(g.attachment)]
        return Hold(self.body, [*grips, grip], self.seen_ns, self.active, self.depth)

    def believes(self, body: Body) -> bool:
        """Whether the performer can be where they are said to be, and has not dropped through the floor."""
        return depth_of(body) <= self.depth + _SUNK

    def see(self, body: Body, time_ns: int) -> None:
        """The performer is in view: their targets, and how firmly they pull."""
        before = self._targets
        joints = [grip.carrying(body.joints) for grip in self.grips]
        held = [grip.attachment for grip in self.grips]
        self._targets = np.concatenate([a.targets(j) for a, j in zip(held, joints, strict=True)])
        pulls = np.concatenate([a.target_weights(body.confidence) for a in held])
        lost = ~(np.abs(self._targets) < _FARTHEST).all(1)
        pulls[lost] = 0.0
        if self._pulls is None or before is None or len(self._pulls) != len(pulls):
            self._pulls = pulls
        else:
            # A joint that is lost lets go where it last was.
            self._targets[lost] = before[lost]
            share = 1.0 - np.exp(-self.away(time_ns) / _SETTLING)
            self._pulls = self._pulls + share * (pulls - self._pulls)
        self.seen_ns = time_ns

    @property
    def targets(self) -> tuple[Float, Float]:
        """(L, 3) where the held points should be, rest space, and (L,) how much each counts."""
        count = len(self)
        if self._targets is None or self._pulls is None or len(self._targets) != count or not self.active:
            return np.zeros((count, 3)), np.zeros(count)
        return self._targets, self._pulls

    def strengths(self, count: int) -> Float:
        """(N,) how strongly each of so many nodes is held, the firmest 1; 0 where not at all."""
        firm = np.zeros(count)
        for grip in self.grips:
            nodes, strengths = grip.attachment.nodes
            firm[nodes] = np.maximum(firm[nodes], strengths)
        return firm


def depth_of(body: Body) -> float:
    """Metres by which the lowest joint is in the floor; 0 where none is."""
    return max(0.0, -float(np.nanmin(body.joints[:, 1], initial=0.0)))


@dataclass(frozen=True)
class Joined:
    """The points of several holds as one set of constraints, in the holds' order."""

    points: Float
    node_indices: Int32
    node_weights: Float


def joined(holds: Sequence[Hold]) -> Joined:
    """Everything that is held."""
    held = [grip.attachment for hold in holds for grip in hold.grips]
    return Joined(
        np.concatenate([np.empty((0, 3)), *(a.points for a in held)]),
        np.concatenate([np.empty((0, 4), np.int32), *(a.node_indices for a in held)]),
        np.concatenate([np.empty((0, 4)), *(a.node_weights for a in held)]),
    )
