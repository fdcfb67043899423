"""Tests of copying images: mirroring, and rotation for an upright monitor."""

from __future__ import annotations

import numpy as np
import pytest

from enliven_viewer.kiosk.picture_copy import PictureCopy


@pytest.fixture(scope="module")
def source(gl):
    """Returns a texture of 4 by 2 pixels, and its brightness as (2, 4), top row first."""
    values = (10 + 30 * np.arange(8, dtype=np.uint8)).reshape(2, 4)
    texture = gl.texture((4, 2), 4, np.repeat(values[::-1, :, None], 4, 2).tobytes())
    texture.filter = gl.NEAREST, gl.NEAREST
    return texture, values


def copy(gl, texture, size, **how) -> np.ndarray:
    """Returns the brightness of a copy, top row first."""
    target = gl.simple_framebuffer(size, 4)
    PictureCopy(gl).draw(texture, target, size, **how)
    width, height = size
    return np.frombuffer(target.read(components=1, alignment=1), np.uint8).reshape(height, width)[::-1]


def test_mirror_exchanges_left_and_right(gl, source):
    texture, values = source
    assert np.array_equal(copy(gl, texture, (4, 2), mirrored=True), values[:, ::-1])


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
def test_picture_is_turned_to_the_right(gl, source, turn):
    texture, values = source
    size = (2, 4) if turn % 180 else (4, 2)
    assert np.array_equal(copy(gl, texture, size, turn=turn), np.rot90(values, -turn // 90))
