"""Field types of messages with their ranges, and conversion of arrays to bytes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from msgspec import Meta

from enliven.arrays import AnyArray

MAX_ID_LENGTH = 64
"""Maximum number of characters in the id of a character or edge: the length of a short sentence."""
Name = Annotated[str, Meta(min_length=1, max_length=MAX_ID_LENGTH)]
Text = Annotated[str, Meta(max_length=400)]
Sentence = Annotated[str, Meta(max_length=160)]
Count = Annotated[int, Meta(ge=0, le=2**53)]
MAX_REVISION = 2**31 - 1
"""Maximum revision of a character: an edge that changes one 30 times per second reaches it in two years."""
RevisionNumber = Annotated[int, Meta(ge=0, le=MAX_REVISION)]
Identity = Annotated[int, Meta(ge=-(2**31), le=2**31 - 1)]
"""Id of a performer."""
Digest = Annotated[bytes, Meta(min_length=32, max_length=32)]
"""SHA-256 of some bytes."""
Nanoseconds = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
MAX_GROWTH = 4.0
"""Maximum scale of a character on a stage. Its inverse is the minimum scale."""
Growth = Annotated[float, Meta(ge=1 / MAX_GROWTH, le=MAX_GROWTH)]
MAX_EXAGGERATION = 4.0
"""Maximum overshoot of soft parts, as a multiple of the overshoot of a mass on a spring. A larger overshoot
looks like an error."""
Exaggeration = Annotated[float, Meta(ge=0.0, le=MAX_EXAGGERATION)]
Number = Annotated[float, Meta(ge=-1e12, le=1e12)]
"""A finite number: msgspec refuses NaN and infinities because of the range."""
Metres = Annotated[float, Meta(gt=0.0, le=100.0)]
"""A length within a stage and its surroundings."""

MAX_TRANSFORM_BYTES = 256 * 1024
"""Maximum bytes of a coded pose: 4096 transforms of 12 numbers with at most 34 bits each, plus a margin."""
MAX_VERTICES = 2_000_000
"""Maximum number of vertices of a character. A larger character from an untrusted sender is refused before
memory is allocated.
"""
MAX_FACES = 4_000_000
"""Maximum number of triangles of a character. A closed mesh has twice as many triangles as vertices."""
MAX_TRANSFORMS = 4096
"""Maximum number of transforms of a pose: a deformation graph has some hundred nodes, a detailed rig some
hundred bones.
"""
MAX_PROPS = 1024
"""Maximum props of a message: more than the physics simulates in real time."""
MAX_SETTINGS_LENGTH = 32 * 1024
"""Maximum length of an actor's settings in characters: enough for all settings with 400 stiff spots."""
MAX_PART_BYTES = 64 * 1024
"""Maximum bytes of one part of an uploaded character, so that the edge can read a part within a frame."""
MAX_UPLOAD_BYTES = 32 * 1024 * 1024
"""Maximum compressed bytes of an uploaded character: about a million vertices. 20,000 vertices take half a
megabyte.
"""
MAX_CHARACTERS = 1024
"""Maximum number of characters on a stage: far more than any edge can animate."""
MAX_MESSAGE_BYTES = 264 * 1024
"""Maximum bytes of one stream message with its topic: a coded pose of the largest character, plus a
margin."""
MAX_LATCHED_MESSAGES = 4096
"""Maximum number of latched messages for a viewer that joins late: 2,000 pieces of a scan, and a few messages
for each character.
"""
MAX_PREVIEW_PIXELS = 128
"""Maximum width and height of the camera preview in pixels. It is shown in a corner of a window."""
MAX_PHRASES = 64
"""Maximum phrases of a voice control: more than a performer remembers, and more than a recogniser can
distinguish."""
MAX_HEALTH = 8
"""Maximum health states of a heartbeat. More states would exceed the message size that older programs
accept."""


def check_length(name: str, data: bytes, length: int) -> None:
    """Raises ValueError if the number of bytes of an array does not match its declared count."""
    if len(data) != length:
        raise ValueError(f"{name} has {len(data)} bytes, expected {length}")


def to_bytes(array: AnyArray | Sequence[int], dtype: str) -> bytes:
    """Returns the array's numbers as bytes of a wire type, such as "<f4"."""
    return np.ascontiguousarray(array, dtype).tobytes()


def from_bytes(data: bytes, dtype: str, columns: int) -> AnyArray:
    """Returns (N, columns) a read-only array in the machine's own byte order."""
    array = np.frombuffer(data, dtype).reshape(-1, columns)
    return array.astype(array.dtype.newbyteorder("="), copy=False)
