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
"""Maximum revision number of a character. An edge that changes a character 30 times per second reaches it
after two years."""
RevisionNumber = Annotated[int, Meta(ge=0, le=MAX_REVISION)]
Identity = Annotated[int, Meta(ge=-(2**31), le=2**31 - 1)]
"""Id of a performer."""
Digest = Annotated[bytes, Meta(min_length=32, max_length=32)]
"""A SHA-256 digest."""
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
"""A length in metres, above 0 and at most 100."""

MAX_TRANSFORM_BYTES = 256 * 1024
"""Maximum size in bytes of an encoded pose: 4096 transforms of 12 numbers with at most 34 bits each, plus a
margin."""
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
"""Maximum number of props in a message. It is more than the physics engine simulates in real time."""
MAX_SETTINGS_LENGTH = 32 * 1024
"""Maximum length in characters of an actor's settings as JSON. It is enough for all settings with 400
stiffness spheres."""
MAX_PART_BYTES = 64 * 1024
"""Maximum size in bytes of one part of an uploaded character. The edge can read such a part within a
frame."""
MAX_UPLOAD_BYTES = 32 * 1024 * 1024
"""Maximum compressed size in bytes of an uploaded character, about a million vertices. 20,000 vertices take
half a megabyte.
"""
MAX_CHARACTERS = 1024
"""Maximum number of characters on a stage: far more than any edge can animate."""
MAX_MESSAGE_BYTES = 264 * 1024
"""Maximum size in bytes of a stream message with its topic: an encoded pose of the largest character, plus a
margin."""
MAX_LATCHED_MESSAGES = 4096
"""Maximum number of latched messages for a viewer that connects late: 2,000 pieces of a scan, and a few
messages for each character.
"""
MAX_PREVIEW_PIXELS = 128
"""Maximum width and height of the camera preview in pixels. It is shown in a corner of a window."""
MAX_PHRASES = 64
"""Maximum number of phrases of a voice control. A performer cannot remember more phrases, and a recogniser
cannot distinguish more."""
MAX_HEALTH = 8
"""Maximum number of health states in a heartbeat. More states would exceed the message size that older
programs accept."""


def check_length(name: str, data: bytes, length: int) -> None:
    """Raises ValueError if the number of bytes of an array does not match its declared count."""
    if len(data) != length:
        raise ValueError(f"the array {name} has {len(data)} bytes, expected {length}")


def to_bytes(array: AnyArray | Sequence[int], dtype: str) -> bytes:
    """Encodes the array's numbers as bytes of the type ``dtype``, such as "<f4"."""
    return np.ascontiguousarray(array, dtype).tobytes()


def from_bytes(data: bytes, dtype: str, columns: int) -> AnyArray:
    """Decodes bytes of the type ``dtype`` to a read-only array (N, ``columns``) in the machine's byte
    order."""
    array = np.frombuffer(data, dtype).reshape(-1, columns)
    return array.astype(array.dtype.newbyteorder("="), copy=False)
