"""Eases a mesh that no performer has been attached to yet into the pose of the performer who may attach
next.

The mesh stays at its waiting position, and its limbs ease into the performer's pose. So a T-posed mesh lowers
its arms before its performer attaches, and no part of it jumps at that moment.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.deformation.embedded.solver import EmbeddedSolver
from enliven.deformation.graph.graph import DeformationGraph
from enliven.person import Body
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.attachment.limb_retargeting import LimbRetargeting
from enliven.possession.attachment.performer_attachment import (
    PerformerAttachment,
    attach_within_reach,
    depth_below_floor,
    join_constraints,
)
from enliven.possession.easing.pose_blend import State


class PoseApproach:
    """A preview of one performer's attachment to a mesh. It is solved like a real attachment, but without
    travel over the floor.

    Args:
        rest_transform: limb-to-limb retargeting, without travel.
        start: the initial state; None starts at rest.
    """

    def __init__(
        self,
        graph: DeformationGraph,
        settings: ActorSettings,
        body: Body,
        rest_transform: LimbRetargeting,
        stiffness: Float | None,
        start: State | None = None,
    ) -> None:
        self.rest_transform = rest_transform
        grip = attach_within_reach(graph, settings, body, "all", rest_transform, None)
        self._hold = PerformerAttachment(body.id, [grip], depth=depth_below_floor(body))
        self._solver = EmbeddedSolver(
            graph, join_constraints([self._hold]), settings.embedded, start, stiffness
        )

    @property
    def body(self) -> int:
        """The id of the performer."""
        return self._hold.body

    def seconds_away(self, time_ns: int) -> float:
        """Returns the seconds since the performer was last in view."""
        return self._hold.seconds_away(time_ns)

    @property
    def state(self) -> State:
        """The last solution."""
        return self._solver.state()

    def advance(self, body: Body | None, time_ns: int) -> State:
        """Returns the state at a time. While the performer is out of view, the state does not change."""
        if body is None or not self._hold.is_credible(body) or not np.isfinite(body.joints).any():
            return self.state
        self._hold.update(body, time_ns)
        return self._solver.solve(*self._hold.targets)
