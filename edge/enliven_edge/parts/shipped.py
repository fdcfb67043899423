"""The forest that ships with the edge, read once."""

from __future__ import annotations

from functools import lru_cache

from enliven_edge.assets import PARTS_FOREST
from enliven_edge.parts.forest import PartForest


@lru_cache(maxsize=1)
def shipped_forest() -> PartForest:
    """The forest trained by ``enliven train-parts``.

    Raises:
        InputError: where its file is missing or damaged.
    """
    return PartForest.load(PARTS_FOREST)
