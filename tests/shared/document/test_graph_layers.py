"""Tests that layers of a possessed mesh refuse placements that cannot be played, and name the wrong value."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from enliven.document import GraphLayer, GraphPart, Ride
from enliven.errors import InputError

UNIT = np.array([0.0, 0.0, 0.0, 1.0])
NO_ROTATIONS = (np.zeros(4), 2.0 * UNIT, np.full(4, np.nan), np.zeros(3))
NO_PLACES = (np.array([0.0, np.inf, 0.0]), np.full(3, np.nan), np.zeros(2))
NO_SIZES = (0.0, -1.0, np.inf, np.nan)


def part(**values: object) -> GraphPart:
    return GraphPart("take", np.arange(2), **values)


def layer(**values: object) -> GraphLayer:
    return GraphLayer(
        "take", **({"nodes": np.arange(2), "own": np.arange(2), "rest": np.zeros((2, 3))} | values)
    )


def ride(**values: object) -> Ride:
    return Ride(**({"node": 0, "turn": UNIT, "place": np.zeros(3)} | values))


CASES = [
    *((part, "axes", turn) for turn in NO_ROTATIONS),
    *((part, "turn", turn) for turn in NO_ROTATIONS),
    *((part, "place", place) for place in NO_PLACES),
    *((part, "size", size) for size in NO_SIZES),
    *((layer, "axes", turn) for turn in NO_ROTATIONS),
    *((layer, "size", size) for size in NO_SIZES),
    *((layer, "weight", weight) for weight in (-0.1, 1.1, np.nan)),
    (layer, "rest", np.full((2, 3), np.nan)),
    *((ride, "turn", turn) for turn in NO_ROTATIONS),
    *((ride, "place", place) for place in NO_PLACES),
    (ride, "node", -1),
]


@pytest.mark.parametrize(("build", "name", "value"), CASES)
def test_value_that_cannot_be_played_is_refused(
    build: Callable[..., object], name: str, value: object
) -> None:
    build()
    with pytest.raises(InputError) as refused:
        build(**{name: value})
    assert refused.value.where


def test_rounding_of_a_rotation_is_accepted() -> None:
    part(turn=UNIT * (1.0 + 1e-7))
