"""Tests of the depth codec: lossless for every image, and an InputError for every damaged payload."""

import struct
import zlib

import numpy as np
import pytest
import zstandard
from archived_depth import encode_archived
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.recording.depth_codec import LAYOUT, decode_depth, encode_depth
from enliven.recording.depth_kernels import predict_image, predict_level

LEVELS = (1, 19, "archived")
"""Levels of zstd, and "archived" for images in archives of earlier versions."""


def packed(image: np.ndarray, level: int | str) -> bytes:
    """Returns the payload of an image."""
    return encode_archived(image) if level == "archived" else encode_depth(image, level)


def room(seed: int = 0, height: int = 120, width: int = 160) -> np.ndarray:
    """Returns a wall and a ball, quantised like a structured-light camera's image, with holes and noise."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:height, :width]
    z = np.where((u - width / 2) ** 2 + (v - height / 2) ** 2 < 900, 1.2, 2.6 + 0.002 * u)
    disparity = np.round(8 * (1090 - 34870 / (100 * z) + rng.normal(0, 0.06, z.shape))) / 8
    depth = np.round(1000 * 348.7 / (1090 - disparity)).astype(np.uint16)
    depth[rng.random(depth.shape) < 0.02] = 0
    depth[:, : width // 20] = 0
    return depth


@st.composite
def images(draw):
    height, width = draw(st.integers(1, 24)), draw(st.integers(1, 24))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    low, high = sorted((draw(st.integers(0, 65535)), draw(st.integers(0, 65535))))
    image = rng.integers(low, high + 1, (height, width), np.uint16)
    step = draw(st.sampled_from([1, 1, 7, 300]))
    image = (image // step * step).astype(np.uint16)
    image[rng.random(image.shape) < draw(st.sampled_from([0.0, 0.3, 0.95]))] = 0
    return image


@pytest.mark.parametrize("level", LEVELS)
@given(image=images())
@settings(deadline=None, max_examples=80)
def test_every_image_comes_back_exactly(level, image):
    assert np.array_equal(decode_depth(packed(image, level)), image)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(
    "image",
    [
        np.zeros((5, 7), np.uint16),
        np.full((5, 7), 65535, np.uint16),
        np.zeros((1, 1), np.uint16),
        np.full((1, 1), 65535, np.uint16),
        np.array([[0, 65535], [65535, 1]], np.uint16),
        np.arange(65536, dtype=np.uint16).reshape(256, 256),
        np.random.default_rng(1).integers(0, 65536, (256, 300), np.uint16),
        np.arange(1, 257, dtype=np.uint16).reshape(16, 16) * 3,
        np.arange(1, 256, dtype=np.uint16).reshape(15, 17) * 3,
        room(),
        room()[::2, ::-3],
    ],
    ids=lambda image: f"{image.shape[0]}x{image.shape[1]}-{image.max()}",
)
def test_images_at_the_edges_come_back_exactly(level, image):
    restored = decode_depth(packed(image, level))
    assert restored.dtype == np.uint16
    assert np.array_equal(restored, image)


@pytest.mark.parametrize("level", LEVELS)
def test_a_read_only_image_is_encoded_and_left_alone(level):
    image = room()
    image.flags.writeable = False
    before = image.copy()
    assert np.array_equal(decode_depth(packed(image, level)), before)
    assert np.array_equal(image, before)


def test_the_same_image_gives_the_same_bytes():
    assert encode_depth(room(3), 19) == encode_depth(room(3), 19)


def test_codec_is_smaller_than_zstd_and_archive_mode_smaller_still():
    image = room(height=240, width=320)
    alone = len(zstandard.ZstdCompressor(level=1).compress(image.tobytes()))
    fast, small = len(encode_depth(image, 1)), len(encode_depth(image, 19))
    assert fast < 0.8 * alone
    assert small < 0.95 * fast


def slow_residuals(image: np.ndarray, ranks: np.ndarray, count: int) -> np.ndarray:
    """Returns the residuals s of packing 0, implemented directly from the documented layout."""
    levels = ranks[image].astype(int)
    residuals = np.zeros(image.shape, int)
    last = (count + 1) // 2
    padded = np.pad(levels, ((1, 0), (1, 1)))
    for y, x in np.ndindex(image.shape):
        w, n, nw, ne = padded[y + 1, x], padded[y, x + 1], padded[y, x], padded[y, x + 2]
        v = levels[y, x]
        if v == 0:
            continue
        if w and n:
            p = int(np.median([w, n, w + n - nw])) if nw else (w + n) // 2
        else:
            p = w or n or ne or last
        r = v - p
        r += count * ((r < -((count - 1) // 2)) - int(r > count // 2))
        residuals[y, x] = 2 * r if r > 0 else 1 - 2 * r
        last = v
    return residuals


@given(image=images())
@settings(deadline=None, max_examples=40)
def test_the_compiled_prediction_is_the_documented_one(image):
    values = np.unique(image[image > 0])
    ranks = np.zeros(65536, np.uint16)
    ranks[values] = np.arange(1, len(values) + 1)
    for table, count in ((ranks, max(len(values), 1)), (np.arange(65536, dtype=np.uint16), 65535)):
        planes = predict_image(image, table, count).astype(int)
        assert len(planes) == (2 if count > 255 else 1)
        assert np.array_equal(
            sum(256**i * plane for i, plane in enumerate(planes)), slow_residuals(image, table, count)
        )


def test_the_prediction_is_the_median_edge_detector():
    rng = np.random.default_rng(0)
    for w, n, nw in rng.integers(1, 50, (200, 3)):
        assert predict_level(w, n, nw, 9, 1) == sorted((w, n, w + n - nw))[1]


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((0, 4), np.uint16),
        np.zeros((4, 4), np.int32),
        np.zeros((4, 4, 1), np.uint16),
        np.zeros((1, 70000), np.uint16),
    ],
)
def test_invalid_depth_image_is_refused(image):
    with pytest.raises(InputError, match="expected"):
        encode_depth(image)


@pytest.mark.parametrize("level", LEVELS)
def test_a_cut_payload_is_refused(level):
    payload = packed(room(), level)
    for size in [0, 1, 5, 13, 14, 15, len(payload) // 2, len(payload) - 1]:
        with pytest.raises(InputError, match="damaged"):
            decode_depth(payload[:size])


@pytest.mark.parametrize("level", LEVELS)
@given(place=st.integers(0, 10**6), bit=st.integers(0, 7))
@settings(deadline=None, max_examples=100)
def test_a_flipped_bit_is_refused(level, place, bit):
    payload = bytearray(packed(room(1, 30, 40), level))
    payload[place % len(payload)] ^= 1 << bit
    with pytest.raises(InputError):
        decode_depth(bytes(payload))


def with_right_checksum(payload: bytes) -> bytes:
    check = zlib.crc32(payload[14:], zlib.crc32(payload[:10]))
    return payload[:10] + struct.pack("<I", check) + payload[14:]


@pytest.mark.parametrize("level", LEVELS)
@given(
    changes=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=8),
    cut=st.integers(0, 60),
)
@settings(deadline=None, max_examples=150)
def test_damage_behind_a_right_checksum_gives_an_image_or_an_input_error(level, changes, cut):
    payload = bytearray(packed(room(1, 30, 40), level))
    for place, value in changes:
        payload[place % len(payload)] = value
    try:
        image = decode_depth(with_right_checksum(bytes(payload[: len(payload) - cut])), max_pixels=1 << 17)
    except InputError:
        return
    assert image.dtype == np.uint16
    assert image.size <= 1 << 17


@pytest.mark.parametrize("packing", [0, 1])
@given(body=st.binary(max_size=300), levels=st.sampled_from([0, 1, 2, 300, 65535, 70000]))
@settings(deadline=None, max_examples=80)
def test_foreign_bytes_give_an_image_or_an_input_error(packing, body, levels):
    payload = struct.pack("<BBHHI", 1, packing, 20, 10, levels) + bytes(4) + body
    try:
        assert decode_depth(with_right_checksum(payload)).shape == (10, 20)
    except InputError as error:
        assert "damaged" in str(error)


def test_a_stated_size_is_limited_before_anything_is_allocated():
    payload = with_right_checksum(struct.pack("<BBHHI", 1, 1, 65535, 65535, 5) + bytes(4) + b"xyz")
    with pytest.raises(InputError, match="65535x65535"):
        decode_depth(payload)
    bomb = zstandard.ZstdCompressor().compress(bytes(1 << 24))
    payload = with_right_checksum(struct.pack("<BBHHI", 1, 0, 8, 8, 5) + bytes(4) + bomb)
    with pytest.raises(InputError, match="16777216 bytes, expected 74"):
        decode_depth(payload)
    with pytest.raises(InputError, match="pixels"):
        decode_depth(encode_depth(room()), max_pixels=100)


def test_later_version_is_reported():
    payload = bytearray(encode_depth(room()))
    payload[0] = 2
    with pytest.raises(InputError, match="version 2"):
        decode_depth(with_right_checksum(bytes(payload)))


def test_the_layout_can_be_followed_by_hand():
    """Decodes packing 0 of a 2x2 image by the documented layout alone."""
    payload = encode_depth(np.array([[1000, 1004], [0, 1000]], np.uint16))
    version, packing, width, height, levels = struct.unpack("<BBHHI", payload[:10])
    assert (version, packing, width, height, levels) == (1, 0, 2, 2, 2)
    content = zstandard.ZstdDecompressor().decompress(payload[14:])
    assert content == bytes([1000 % 256, 4, 1000 // 256, 0]) + bytes([1, 2, 0, 2])
    assert "packing 0: one zstd frame" in LAYOUT.lower()
