"""What of a mesh is held, and what would be: for the viewer's highlights."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from enliven.arrays import Float, Int

State = Literal["free", "possessed"]


@dataclass(frozen=True)
class Cues:
    """What the viewer highlights: the nodes that are held, and those that would be held now.

    Attributes:
        state: "free" or "possessed".
        nodes: (K,) node indices; the first ``held`` are held, the others would be.
        strengths: (K,) in (0, 1].
        body: the id of the performer who holds, or would; the first of them; -1 for nobody.
        owners: (K,) whose each node is.
        held: how many of the nodes are held; the others are a preview.
    """

    state: State
    nodes: Int
    strengths: Float
    body: int
    owners: Int = field(default_factory=lambda: np.empty(0, np.int64))
    held: int = 0


def cues_of(
    held: Iterable[tuple[int, dict[int, float]]], preview: tuple[int, dict[int, float]] | None
) -> Cues:
    """The cues of who holds what, by performer, and of who would; a node is the one's who holds it firmest.

    Args:
        held: performer and strengths by node, of everybody who holds.
        preview: the same of who would take hold.
    """
    firmest: dict[int, tuple[float, int]] = {}
    holders = list(held)
    for body, nodes in holders:
        for node, strength in nodes.items():
            if strength > firmest.get(node, (0.0, 0))[0]:
                firmest[node] = (strength, body)
    rows = [(node, strength, body) for node, (strength, body) in sorted(firmest.items())]
    taken = len(rows)
    if preview is not None:
        rows += [(n, s, preview[0]) for n, s in sorted(preview[1].items()) if n not in firmest]
    first = holders[0][0] if holders else preview[0] if preview is not None and rows else -1
    return Cues(
        "possessed" if holders else "free",
        np.array([row[0] for row in rows], np.int64),
        np.array([row[1] for row in rows], np.float64),
        first,
        np.array([row[2] for row in rows], np.int64),
        taken,
    )
