"""One performer's hold on an embedded mesh: which bones hold which points, and how firmly just now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from enliven.arrays import Float, Int32
from enliven.person import Body
from enliven.possession.attachment import Attachment
from enliven.possession.carrying import Carrying

_SETTLING = 0.12
"""Seconds in which most of a change of confidence takes effect: it flickers, and the mesh would shake."""

_FARTHEST = 1e4
"""Metres from the rest origin beyond which a target is no measurement: far beyond any room."""

_SUNK = 0.06
"""Metres that the lowest joint may sink below its depth at the start of the hold: the skeleton of a
half-hidden performer drops through the floor before it is lost, and is not believed then."""


@dataclass
class Grip:
    """An attachment with its carrying of joints; a performer who takes hold again has several.

    Attributes:
        attachment: the points that the body drives.
        carrying: brings joints from the world into the rest space.
        parts: the parts of the body that took hold.
        start_turns: (19, 3, 3) the carrying's turns when the body attached; None: the identity.
    """

    attachment: Attachment
    carrying: Carrying
    parts: str
    start_turns: Float | None = None

    def targets(self, body: Body) -> Float:
        """Returns (L, 3) metres in the rest space, where the held points should be now."""
        joints = self.carrying(body.joints)
        turns = self.carrying.turns
        if turns is not None and self.start_turns is not None:
            turns = turns @ np.swapaxes(self.start_turns, 1, 2)
        return self.attachment.targets(joints, turns)


@dataclass
class EmbeddedHold:
    """Everything that one performer holds of an embedded mesh.

    Attributes:
        body: the performer's id.
        grips: one for each time that the performer took hold.
        seen_ns: when they were last in view, the sensor's clock; None before the first frame.
        active: whether the performer pulls just now.
        depth: metres by which the performer stood below the floor when they took hold: its height is inexact.
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
        """The carrying of the last grip, which brings the performer's surface into the rest space too."""
        return self.grips[-1].carrying

    def __len__(self) -> int:
        return sum(len(grip.attachment) for grip in self.grips)

    def away(self, time_ns: int) -> float:
        """Returns the seconds since, or until, the performer was last in view: the clock may go back."""
        return 0.0 if self.seen_ns is None else abs(time_ns - self.seen_ns) * 1e-9

    def with_grip(self, grip: Grip) -> EmbeddedHold:
        """Returns the same hold with another grip; the bones of the new grip leave all older ones."""
        anew = np.unique(grip.attachment.bone)
        grips = [
            replace(g, attachment=g.attachment.only(~np.isin(g.attachment.bone, anew))) for g in self.grips
        ]
        grips = [g for g in grips if len(g.attachment)]
        return EmbeddedHold(self.body, [*grips, grip], self.seen_ns, self.active, self.depth)

    def believes(self, body: Body) -> bool:
        """Returns whether the body is credible: whether it has not sunk through the floor."""
        return depth_of(body) <= self.depth + _SUNK

    def see(self, body: Body, time_ns: int) -> None:
        """Updates the targets and the pulls from a performer in view."""
        before = self._targets
        for grip in self.grips:
            grip.carrying.at(time_ns)
        self._targets = np.concatenate([grip.targets(body) for grip in self.grips])
        pulls = np.concatenate([grip.attachment.target_weights(body.confidence) for grip in self.grips])
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
        """(L, 3) targets of the held points, metres in the rest space, and the (L,) weight of each."""
        count = len(self)
        if self._targets is None or self._pulls is None or len(self._targets) != count or not self.active:
            return np.zeros((count, 3)), np.zeros(count)
        return self._targets, self._pulls

    def strengths(self, count: int) -> Float:
        """Returns (N,) how strongly each of ``count`` nodes is held, from 0 to 1."""
        firm = np.zeros(count)
        for grip in self.grips:
            nodes, strengths = grip.attachment.nodes
            firm[nodes] = np.maximum(firm[nodes], strengths)
        return firm


def depth_of(body: Body) -> float:
    """Returns the metres by which the lowest joint is below the floor; 0 where none is."""
    return max(0.0, -float(np.nanmin(body.joints[:, 1], initial=0.0)))


@dataclass(frozen=True)
class Joined:
    """The points of several holds as one set of constraints, in the holds' order."""

    points: Float
    node_indices: Int32
    node_weights: Float


def joined(holds: Sequence[EmbeddedHold]) -> Joined:
    """Returns the points of all holds."""
    held = [grip.attachment for hold in holds for grip in hold.grips]
    return Joined(
        np.concatenate([np.empty((0, 3)), *(a.points for a in held)]),
        np.concatenate([np.empty((0, 4), np.int32), *(a.node_indices for a in held)]),
        np.concatenate([np.empty((0, 4)), *(a.node_weights for a in held)]),
    )
