"""A separate program around MediaPipe: images on its input, landmarks on its output.

It is a separate process because MediaPipe is large and may terminate its process. The MediaPipe version that
contains the model (0.10.21) also needs another NumPy than the edge. The program imports no module of enliven,
so the Python of another environment can run it:

    python worker.py            MediaPipe 0.10.21 or older, with the model inside its wheel
    python worker.py FILE.task  MediaPipe 1 or newer, with a pose landmarker's model bundle

Input: for each image, its height and width (uint32) and its time in milliseconds (int64), then h*w*3 bytes of
sRGB. Output: a line with the word "ready". Then, for each image, the number of people (uint32), and for each
person 33 x 6 float32: x and y in pixels, visibility, and X, Y, Z in metres from the hips. All numbers are
little-endian.
"""

import os
import struct
import sys
from collections.abc import Callable
from typing import Any, BinaryIO

import numpy as np

Finder = Callable[[np.ndarray, int], list[Any]]
"""Function that returns the people in an image, from (H, W, 3) uint8 sRGB and a time in milliseconds."""

HEADER = struct.Struct("<IIq")
"""Layout of the input before each image: its height, its width and its time in milliseconds."""


def _create_legacy_finder() -> Finder:
    """Returns the detector of MediaPipe up to 0.10.21: one person."""
    import mediapipe  # type: ignore[import-not-found]

    pose = mediapipe.solutions.pose.Pose(static_image_mode=False, model_complexity=1)

    def find(image: np.ndarray, milliseconds: int) -> list[Any]:
        result = pose.process(image)
        if result.pose_landmarks is None:
            return []
        return [(result.pose_landmarks.landmark, result.pose_world_landmarks.landmark)]

    return find


def _create_tasks_finder(model: str) -> Finder:
    """Returns the detector of MediaPipe 1: several people."""
    import mediapipe  # type: ignore[import-not-found]
    from mediapipe.tasks.python import BaseOptions, vision  # type: ignore[import-not-found]

    options = vision.PoseLandmarkerOptions(
        base_options=BaseOptions(model_asset_path=model),
        running_mode=vision.RunningMode.VIDEO,
        num_poses=4,
    )
    landmarker = vision.PoseLandmarker.create_from_options(options)

    def find(image: np.ndarray, milliseconds: int) -> list[Any]:
        mediapipe_image = mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=image)
        result = landmarker.detect_for_video(mediapipe_image, milliseconds)
        return list(zip(result.pose_landmarks, result.pose_world_landmarks, strict=True))

    return find


def pack_people(people: list[Any], width: int, height: int) -> bytes:
    """Returns the output for the people in an image of this size: their number, then their landmarks."""
    rows = [
        [
            (
                point.x * width,
                point.y * height,
                point.visibility or 0.0,
                position.x,
                position.y,
                position.z,
            )
            for point, position in zip(points, places, strict=True)
        ]
        for points, places in people
    ]
    return struct.pack("<I", len(rows)) + np.array(rows, "<f4").tobytes()


def _read_exactly(stream: BinaryIO, count: int) -> bytes:
    """Reads ``count`` bytes. Returns b"" if the stream ends before."""
    data = stream.read(count)
    return data if data is not None and len(data) == count else b""


def main() -> None:
    """Reads images from the standard input, and writes the landmarks of each to the standard output."""
    # Redirect the output of MediaPipe's libraries, because it must not mix with the landmarks.
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    find = _create_tasks_finder(sys.argv[1]) if len(sys.argv) > 1 else _create_legacy_finder()
    output.write(b"ready\n")
    output.flush()
    while head := _read_exactly(sys.stdin.buffer, HEADER.size):
        height, width, milliseconds = HEADER.unpack(head)
        data = _read_exactly(sys.stdin.buffer, height * width * 3)
        if not data:
            return
        image = np.frombuffer(data, np.uint8).reshape(height, width, 3)
        output.write(pack_people(find(image, milliseconds), width, height))
        output.flush()


if __name__ == "__main__":
    main()
