"""The schemas and layouts of a recording's messages. Every file contains them."""

from __future__ import annotations

import json
from dataclasses import dataclass

from enliven.recording.depth_codec import LAYOUT as DEPTH_CODEC_LAYOUT

PROFILE = "enliven"
"""The MCAP profile of enliven's recordings. Files with this profile have the topics and layouts below."""

RECORDING_VERSION = 1
"""Version of all topics and layouts, including those of network messages. It changes if existing bytes change
their meaning, but not if a topic or a field is added."""
ABOUT_NAME = "about"
"""Name of the metadata record that describes the file."""
VERSION_KEY = "version"
"""Key of the version in the record "about". Recordings of enliven 0.1 lack it and have version 1."""

DEPTH_TOPIC = "/depth"
BODIES_TOPIC = "/bodies"
TRUTH_TOPIC = "/truth/bodies"


@dataclass(frozen=True)
class MessageKind:
    """A schema, and the encoding of messages with this schema."""

    schema_name: str
    schema_encoding: str
    schema_text: str
    message_encoding: str


DEPTH_LAYOUT = (
    """\
enliven depth frame, version 1 (little endian)

offset size
 0     1    version = 1
 1     1    flags: 1 = world_from_camera is present, 2 = colour is present, 4 = the sequence number is
 2     2    S, bytes of the sensor's identity
 4     4    D, bytes of the depth image
 8     8    time, int64 nanoseconds of the sensor's clock
16    72    fx, fy, cx, cy (pixels), k1, k2, p1, p2, k3 (Brown-Conrady, OpenCV), float64
88     S    the sensor's identity, UTF-8
      128   only with flag 1: world_from_camera, 4x4 float64, row-major, metres; world +Y up, camera OpenCV's
      D     the depth image in millimetres, 0 = nothing measured, as below
      8     only with flag 2: height and width of the colour image, uint32
      ...   only with flag 2: one zstd frame of h*w*3 bytes sRGB, each the difference (modulo 256) to the
            same channel of the pixel to its left (0 left of the first)
      8     only with flag 4, the last bytes: the sensor's own count of its images, int64; a gap is a loss

"""
    + DEPTH_CODEC_LAYOUT
)

_NUMBER_SCHEMA = {"type": ["number", "null"]}
_BODY_SCHEMA = {
    "type": "object",
    "required": ["id", "joints", "confidence"],
    "properties": {
        "id": {"type": "integer", "description": "stable while the person is in view"},
        "joints": {
            "type": "array",
            "description": "20 joints in the Kinect SDK 1.x order: [x, y, z] metres, world frame, +Y up",
            "items": {"type": "array", "items": _NUMBER_SCHEMA},
        },
        "confidence": {"type": "array", "description": "20 numbers, 0 (guess) to 1", "items": _NUMBER_SCHEMA},
        "orientations": {
            "type": ["array", "null"],
            "description": "20 quaternions [w, x, y, z] world_from_bone, or null",
            "items": {"type": "array", "items": _NUMBER_SCHEMA},
        },
        "contacts": {
            "type": ["array", "null"],
            "description": "probability that the left and the right foot stand on the floor, or null",
            "items": _NUMBER_SCHEMA,
        },
        "stature": {
            **_NUMBER_SCHEMA,
            "description": "metres from soles to crown, standing straight, or null",
        },
    },
}
BODIES_SCHEMA = json.dumps(
    {
        "title": "enliven.BodyFrame",
        "description": "The bodies that were seen at one moment. Numbers are float64; null is not-a-number.",
        "type": "object",
        "required": ["time_ns", "sensor", "bodies"],
        "properties": {
            "time_ns": {"type": "integer", "description": "nanoseconds of the sensor's clock"},
            "sensor": {"type": "string"},
            "bodies": {"type": "array", "items": _BODY_SCHEMA},
        },
    },
    indent=1,
)

DEPTH = MessageKind("enliven.DepthFrame", "text", DEPTH_LAYOUT, "enliven-depth")
BODIES = MessageKind("enliven.BodyFrame", "jsonschema", BODIES_SCHEMA, "json")

ABOUT = {
    VERSION_KEY: str(RECORDING_VERSION),
    "what": "A recording of enliven: what a depth sensor saw, or the bodies that were seen",
    DEPTH_TOPIC: "depth images in millimetres; the schema states every byte",
    BODIES_TOPIC: "bodies tracked by the sensor or by another program",
    TRUTH_TOPIC: "the true bodies, where the recording was made and not seen",
    "time": "log time is the sensor's own clock in nanoseconds",
    "units": "metres; world right-handed, +Y up, floor at y = 0",
}
"""The metadata record that describes the content for users."""
