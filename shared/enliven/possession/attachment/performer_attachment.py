"""The attachment of one performer to an embedded mesh: the attached points, their targets, and their current
strength."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from enliven.arrays import Float, Int32
from enliven.deformation.graph.graph import DeformationGraph
from enliven.errors import InputError
from enliven.person import Body, parse_parts
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.attachment.bone_attachment import Attachment, ReachGrowth, attach
from enliven.possession.attachment.rest_transform import RestTransform

_STRENGTH_TIME_CONSTANT_S = 0.12
"""Time constant in seconds of the low-pass filter on the strength of an attachment. Without the filter,
flickering tracking confidence would shake the mesh."""

_MAX_TARGET_M = 1e4
"""Maximum distance of a valid target from the origin of the rest space, metres. It is larger than any
room."""

_MAX_SINKING_M = 0.06
"""Maximum depth, metres, of the lowest joint below its level at the time of attaching. The tracked skeleton
of a half-occluded performer sinks through the floor before it is lost. A deeper skeleton is ignored."""

_MIN_ATTACHED_FRACTION = 0.9
"""Minimum fraction of the bones that must attach if the joints are already inside the mesh."""


@dataclass
class TransformedAttachment:
    """An attachment with the transform of the performer's joints into the rest space. A performer who
    attaches several times has several attachments.

    Attributes:
        attachment: the points of the mesh that the body drives.
        rest_transform: transforms joints from the world into the rest space.
        parts: the name of the body parts that attached.
        start_turns: (19, 3, 3) bone rotations of the transform at the time of attaching; None means the
            identity.
    """

    attachment: Attachment
    rest_transform: RestTransform
    parts: str
    start_turns: Float | None = None

    def targets(self, body: Body) -> Float:
        """Returns the current target positions (L, 3) of the attached points, metres, rest space."""
        joints = self.rest_transform(body.joints)
        turns = self.rest_transform.turns
        if turns is not None and self.start_turns is not None:
            turns = turns @ np.swapaxes(self.start_turns, 1, 2)
        return self.attachment.targets(joints, turns)


@dataclass
class PerformerAttachment:
    """The hold of one performer, that is, all of the performer's attachments to an embedded mesh.

    Attributes:
        body: the performer's id.
        attachments: one for each time that the performer attached.
        seen_ns: time at which the performer was last in view, nanoseconds of the sensor's clock. None before
            the first frame.
        active: True if the performer currently drives the mesh.
        depth: depth of the performer's lowest joint below the floor at the time of attaching, metres. It may
            differ from 0, because the floor height is inexact.
    """

    body: int
    attachments: list[TransformedAttachment]
    seen_ns: int | None = None
    active: bool = True
    depth: float = 0.0
    _targets: Float | None = field(default=None, repr=False)
    _pulls: Float | None = field(default=None, repr=False)

    @property
    def rest_transform(self) -> RestTransform:
        """The transform of the last attachment, which also transforms the performer's surface."""
        return self.attachments[-1].rest_transform

    def __len__(self) -> int:
        return sum(len(grip.attachment) for grip in self.attachments)

    def seconds_away(self, time_ns: int) -> float:
        """Returns the time, in seconds, since the performer was last in view. It is positive even if the
        clock jumps backwards.
        """
        return 0.0 if self.seen_ns is None else abs(time_ns - self.seen_ns) * 1e-9

    def with_attachment(self, grip: TransformedAttachment) -> PerformerAttachment:
        """Returns the hold with an additional attachment. Bones of the new attachment are removed from all
        older attachments.
        """
        is_new = np.unique(grip.attachment.bone)
        grips = [
            replace(g, attachment=g.attachment.select_points(~np.isin(g.attachment.bone, is_new)))
            for g in self.attachments
        ]
        grips = [g for g in grips if len(g.attachment)]
        return PerformerAttachment(self.body, [*grips, grip], self.seen_ns, self.active, self.depth)

    def is_credible(self, body: Body) -> bool:
        """Returns True if the tracked body is credible, that is, it has not sunk through the floor."""
        return depth_below_floor(body) <= self.depth + _MAX_SINKING_M

    def update(self, body: Body, time_ns: int) -> None:
        """Updates the targets and their weights from the body of a performer in view."""
        last_targets = self._targets
        for grip in self.attachments:
            grip.rest_transform.set_time(time_ns)
        self._targets = np.concatenate([grip.targets(body) for grip in self.attachments])
        pulls = np.concatenate([grip.attachment.target_weights(body.confidence) for grip in self.attachments])
        lost = ~(np.abs(self._targets) < _MAX_TARGET_M).all(1)
        pulls[lost] = 0.0
        if self._pulls is None or last_targets is None or len(self._pulls) != len(pulls):
            self._pulls = pulls
        else:
            # Keep the last target for the points of a lost joint while their weight decays.
            self._targets[lost] = last_targets[lost]
            blend = 1.0 - np.exp(-self.seconds_away(time_ns) / _STRENGTH_TIME_CONSTANT_S)
            self._pulls = self._pulls + blend * (pulls - self._pulls)
        self.seen_ns = time_ns

    @property
    def targets(self) -> tuple[Float, Float]:
        """(L, 3) targets of the attached points, metres in the rest space, and (L,) their weights."""
        count = len(self)
        if self._targets is None or self._pulls is None or len(self._targets) != count or not self.active:
            return np.zeros((count, 3)), np.zeros(count)
        return self._targets, self._pulls

    def strengths(self, count: int) -> Float:
        """Returns the strength (N,), from 0 to 1, of the attachment of each of ``count`` nodes."""
        firm = np.zeros(count)
        for grip in self.attachments:
            nodes, strengths = grip.attachment.nodes
            firm[nodes] = np.maximum(firm[nodes], strengths)
        return firm


def depth_below_floor(body: Body) -> float:
    """Returns the depth of the lowest joint below the floor, metres, or 0 if no joint is below the floor."""
    return max(0.0, -float(np.nanmin(body.joints[:, 1], initial=0.0)))


@dataclass(frozen=True)
class ConstraintSet:
    """The attached points of several performers as one set of constraints, in the order of the performers."""

    points: Float
    node_indices: Int32
    node_weights: Float


def join_constraints(holds: Sequence[PerformerAttachment]) -> ConstraintSet:
    """Concatenates the attached points of all performers to one set of constraints."""
    attachments = [grip.attachment for hold in holds for grip in hold.attachments]
    return ConstraintSet(
        np.concatenate([np.empty((0, 3)), *(a.points for a in attachments)]),
        np.concatenate([np.empty((0, 4), np.int32), *(a.node_indices for a in attachments)]),
        np.concatenate([np.empty((0, 4)), *(a.node_weights for a in attachments)]),
    )


def attach_within_reach(
    graph: DeformationGraph,
    settings: ActorSettings,
    body: Body,
    parts: str,
    rest_transform: RestTransform,
    deformed: tuple[Float, Float] | None,
) -> TransformedAttachment:
    """Attaches a body, transformed by ``rest_transform``, to a graph.

    Lengths in the settings are measured in the performer's metres.

    Args:
        rest_transform: transform from the world into the rest space.
        deformed: current (N, 3, 3) linear parts and (N, 3) positions of the nodes. None if the mesh is at
            rest.
    """
    attachment_settings, metre = settings.attachment, 1.0 / rest_transform.scale
    scaled_settings = replace(
        attachment_settings,
        radius=metre * attachment_settings.radius,
        reach=metre * attachment_settings.reach,
    )
    grow = ReachGrowth(
        _MIN_ATTACHED_FRACTION if rest_transform.fits else settings.enough, metre * settings.farthest_reach
    )
    joints, start_turns = rest_transform(body.joints), rest_transform.turns
    if rest_transform.at_rest is not None:
        joints, deformed, start_turns = rest_transform.at_rest, None, None
    attachment = attach(graph, joints, body.confidence, parts, scaled_settings, deformed, grow)
    return TransformedAttachment(attachment, rest_transform, parts, start_turns)


def make_out_of_reach_error(
    character: str,
    settings: ActorSettings,
    body: Body,
    grip: TransformedAttachment,
    nodes: Float,
    *,
    comes: bool = False,
) -> InputError:
    """Returns the error that explains why a body could not attach, and suggests a remedy.

    Args:
        grip: the attachment, which is empty.
        nodes: (N, 3) metres, current positions of the nodes in the rest space.
        comes: True if the mesh moves to the body. Then it does not help if the performer steps nearer.
    """
    joints = grip.rest_transform(body.joints)[sorted(parse_parts(grip.parts))]
    distances = np.linalg.norm(joints[:, None] - nodes, axis=2)
    metres = float(np.nanmin(distances, initial=np.inf)) * grip.rest_transform.scale
    distance_text = (
        f"; the nearest part is {metres:.1f} m away" if np.isfinite(metres) else "; no joint is tracked"
    )
    advice = "Step into the mesh, or set place = 'meet', or how = 'beside'."
    if comes:
        advice = "Attach with the whole body, or with other parts of the body."
    return InputError(
        f"no part of the mesh is within {settings.farthest_reach} m of the body{distance_text}",
        where=f"possessing {character!r} with {grip.parts}",
        remedy=advice,
    )
