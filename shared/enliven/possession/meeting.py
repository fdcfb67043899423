"""A mesh that was not held yet comes to the pose of the performer who may take hold of it next.

It stays where it waits, and its limbs go where theirs are, eased. So a T-posed mesh lets its arms hang before
its performer has it, and nothing of it jumps as they take hold.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.deformation.embedded import EmbeddedSolver
from enliven.deformation.graph import DeformationGraph
from enliven.person import Body
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.grip import gripped
from enliven.possession.hold import EmbeddedHold, depth_of, joined
from enliven.possession.mapped import Mapped

State = tuple[Float, Float]
"""(N, 3, 3) linear parts and (N, 3) positions in the rest space."""


class Meeting:
    """What one performer would hold of a mesh, solved as if they did, but for the way that they go.

    Args:
        carrying: limb drives limb, without travel.
        start: the state to begin from; None: at rest.
    """

    def __init__(
        self,
        graph: DeformationGraph,
        settings: ActorSettings,
        body: Body,
        carrying: Mapped,
        stiffness: Float | None,
        start: State | None = None,
    ) -> None:
        self.carrying = carrying
        grip = gripped(graph, settings, body, "all", carrying, None)
        self._hold = EmbeddedHold(body.id, [grip], depth=depth_of(body))
        self._solver = EmbeddedSolver(graph, joined([self._hold]), settings.embedded, start, stiffness)

    @property
    def body(self) -> int:
        """The id of the performer."""
        return self._hold.body

    def away(self, time_ns: int) -> float:
        """Returns the seconds since the performer was last in view."""
        return self._hold.away(time_ns)

    @property
    def state(self) -> State:
        """The last answer."""
        return self._solver.state()

    def at(self, body: Body | None, time_ns: int) -> State:
        """The state at a moment; the last one while the performer is out of view."""
        if body is None or not self._hold.believes(body) or not np.isfinite(body.joints).any():
            return self.state
        self._hold.see(body, time_ns)
        return self._solver.solve(*self._hold.targets)
