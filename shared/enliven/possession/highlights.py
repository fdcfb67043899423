"""The nodes of a mesh that the viewer highlights: nodes with attached performers, and nodes that the next
performer would attach to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from enliven.arrays import Float, Int

State = Literal["free", "possessed"]


@dataclass(frozen=True)
class Cues:
    """The nodes that the viewer highlights: those with attached performers, and a preview of those that would
    be attached next.

    Attributes:
        state: "free" or "possessed".
        nodes: (K,) node indices. Performers are attached to the first ``held`` of them. The others are a
            preview.
        strengths: (K,) strength of the attachment of each node, in (0, 1].
        body: the id of the first attached performer. Without one, the id of the performer in the preview, or
            -1 without a preview.
        owners: (K,) the id of the performer that each node belongs to.
        held: number of nodes with attached performers.
    """

    state: State
    nodes: Int
    strengths: Float
    body: int
    owners: Int = field(default_factory=lambda: np.empty(0, np.int64))
    held: int = 0


def make_cues(held: Sequence[tuple[int, Float]], preview: tuple[int, Float] | None) -> Cues:
    """Computes the cues. If several performers are attached to a node, it belongs to the one with the
    greatest strength.

    Args:
        held: for each attached performer, the id and the strength (N,) on each node.
        preview: id and strengths of the performer who would attach next.
    """
    holders = [body for body, _ in held]
    nodes, strengths, owners = np.empty(0, np.int64), np.empty(0), np.empty(0, np.int64)
    if held:
        every = np.stack([strength for _, strength in held])
        firmest = every.max(0)
        nodes = np.flatnonzero(firmest > 0)
        strengths, owners = firmest[nodes], np.array(holders)[every.argmax(0)[nodes]]
    held_count = len(nodes)
    if preview is not None:
        also = np.flatnonzero(preview[1] > 0)
        also = also[~np.isin(also, nodes)]
        nodes, strengths = np.concatenate([nodes, also]), np.concatenate([strengths, preview[1][also]])
        owners = np.concatenate([owners, np.full(len(also), preview[0])])
    first_body = holders[0] if holders else int(owners[0]) if len(owners) else -1
    return Cues("possessed" if holders else "free", nodes, strengths, first_body, owners, held_count)
