"""Tests of the message of solved surfaces."""

from __future__ import annotations

import msgspec
import numpy as np

from enliven_viewer.web.surfaces import pack_surface


def test_vertices_are_exact_to_half_a_step() -> None:
    vertices = np.random.default_rng(1).uniform([-1, 0, 2], [1, 1.8, 2.5], (500, 3)).astype(np.float32)
    data = pack_surface("cactus", 3, vertices)
    assert data.startswith(b"surface\0\x01")
    character, revision, low, step, steps = msgspec.msgpack.decode(data[9:])
    assert (character, revision) == ("cactus", 3)
    decoded = low + step * np.frombuffer(steps, "<u2").reshape(-1, 3)
    assert np.abs(decoded - vertices).max() < 0.51 * step < 2e-5


def test_flat_surface_has_finite_numbers() -> None:
    data = pack_surface("a point", 1, np.full((4, 3), 2.5, np.float32))
    _, _, low, step, steps = msgspec.msgpack.decode(data[9:])
    assert low == [2.5] * 3 and 0 < step < 1e-6 and not any(steps)
