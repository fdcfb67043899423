"""Body landmarks in a colour image (the 33 points of BlazePose), and their detection by MediaPipe."""

from __future__ import annotations

import importlib.util
import struct
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from enliven.arrays import Float, UInt8
from enliven.errors import InputError, ResourceError
from enliven.files import user_data_folder
from enliven.settings import setting
from enliven.supervision.closeable import Closeable

NAMES: tuple[str, ...] = (
    "nose", "left eye inner", "left eye", "left eye outer", "right eye inner", "right eye", "right eye outer",
    "left ear", "right ear", "mouth left", "mouth right", "left shoulder", "right shoulder", "left elbow",
    "right elbow", "left wrist", "right wrist", "left pinky", "right pinky", "left index", "right index",
    "left thumb", "right thumb", "left hip", "right hip", "left knee", "right knee", "left ankle",
    "right ankle", "left heel", "right heel", "left foot index", "right foot index",
)  # fmt: skip
"""(33,) names of the landmarks. Left and right are the performer's own."""
INDEX = {name: i for i, name in enumerate(NAMES)}


@dataclass(frozen=True)
class Landmarks:
    """One person in one colour image.

    Attributes:
        points: (33, 2) pixels of the image, x to the right and y down. They may be outside the image.
        visibility: (33,) in [0, 1]: probability that the landmark is in the image and not occluded.
        offsets: (33, 3) metres from the middle of the hips along the camera's axes (OpenCV's): the detector's
            3D posture. Its scale is a guess.
    """

    points: Float
    visibility: Float
    offsets: Float


class LandmarkSource(Closeable, Protocol):
    """Detects people in colour images."""

    def find(self, colour: UInt8, time_ns: int) -> list[Landmarks]:
        """Returns the people in an (h, w, 3) uint8 sRGB image.

        Args:
            time_ns: the sensor's clock, increasing from call to call.

        Raises:
            ResourceError: if the detector has failed permanently.
        """
        ...


HEADER = struct.Struct("<IIq")
"""Layout of the worker's input before each image: its height, its width and its time in milliseconds."""
_PERSON_BYTES = len(NAMES) * 6 * 4
"""Bytes of one person in the worker's output: six float32 values for each landmark."""
_MODEL = "pose_landmarker.task"
"""File name of the default model in the user's own folder."""
_MAX_PEOPLE = 64
"""Maximum number of people in an image. A larger number from the worker means corrupt data."""
_INSTALL_HINT = (
    "Install the extra 'colour' (pip install \"./edge[colour]\"), and set model to a .task file. Or set "
    "python to the interpreter of an environment with mediapipe 0.10.21, which contains a model."
)


@dataclass(frozen=True)
class MediaPipeSettings:
    """Location of MediaPipe and its model."""

    python: str = setting(
        "", "Path of a Python interpreter with mediapipe. If empty, the edge's own interpreter."
    )
    model: str = setting(
        "", "Path of a pose landmarker model (.task). Not needed for mediapipe up to 0.10.21."
    )

    @property
    def model_file(self) -> Path | None:
        """Returns the model to use: the configured one, or else the user's own if it exists."""
        default_model = user_data_folder() / _MODEL
        return Path(self.model) if self.model else default_model if default_model.is_file() else None

    def check(self) -> None:
        """Checks the settings without starting MediaPipe.

        Raises:
            InputError: for a model file that does not exist.
            ResourceError: if MediaPipe is not installed, or contains no model and none is given.
        """
        model = self.model_file
        if model is not None and not model.is_file():
            remedy = "Set model to the path of a .task file."
            raise InputError("the model file does not exist", where=str(model), remedy=remedy)
        if self.python:
            return
        spec = importlib.util.find_spec("mediapipe")
        if spec is None:
            problem = "the library 'mediapipe' is not installed"
            raise ResourceError(problem, where="landmarks", remedy=_INSTALL_HINT)
        folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
        if model is None and not any((folder / "python" / "solutions").is_dir() for folder in folders):
            default_model = user_data_folder() / _MODEL
            remedy = (
                f"Download the .task file of a pose landmarker. Save it as {default_model}, or set model "
                "to its path."
            )
            raise ResourceError(
                "this version of MediaPipe contains no pose model", where="landmarks", remedy=remedy
            )


class MediaPipeSource(LandmarkSource):
    """Detects landmarks with MediaPipe in a separate process, see :mod:`enliven_edge.landmarks.worker`.

    Raises:
        InputError: for a model file that does not exist.
        ResourceError: if MediaPipe or its model is missing, or it cannot be started.
    """

    def __init__(self, settings: MediaPipeSettings | None = None) -> None:
        self.settings = settings or MediaPipeSettings()
        self.settings.check()
        model = self.settings.model_file
        command = [self.settings.python or sys.executable, str(Path(__file__).with_name("worker.py"))]
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 (closed by close)
        self._newest_ms = -1
        try:
            self._worker = subprocess.Popen(
                [*command, str(model)] if model else command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
            )
        except OSError as error:
            self._said.close()
            raise ResourceError(
                f"this Python interpreter cannot be started ({error.strerror})",
                where=command[0],
                remedy=_INSTALL_HINT,
            ) from None
        assert self._worker.stdin is not None and self._worker.stdout is not None
        self._in, self._out = self._worker.stdin, self._worker.stdout
        if self._out.readline() != b"ready\n":
            raise self._process_error()

    def find(self, colour: UInt8, time_ns: int) -> list[Landmarks]:
        """Returns the people that the worker finds in an (h, w, 3) uint8 sRGB image. Waits for its answer.

        MediaPipe requires increasing milliseconds, so the time of a frame in the same millisecond is
        increased.

        Raises:
            ResourceError: if the worker has ended, or sends impossible data.
        """
        height, width = colour.shape[:2]
        self._newest_ms = max(self._newest_ms + 1, time_ns // 1_000_000)
        try:
            self._in.write(HEADER.pack(height, width, self._newest_ms))
            self._in.write(np.ascontiguousarray(colour, np.uint8).tobytes())
            self._in.flush()
            count = struct.unpack("<I", self._read_exactly(4))[0]
            if count > _MAX_PEOPLE:
                raise self._process_error()
            people = [self._read_exactly(_PERSON_BYTES) for _ in range(count)]
        except (BrokenPipeError, ValueError):
            raise self._process_error() from None
        return [_parse_person(person) for person in people]

    def close(self) -> None:
        """Ends the worker, and closes the pipes to it. A second call does nothing."""
        if self._worker.poll() is None:
            self._worker.terminate()
            self._worker.wait()
        for stream in (self._in, self._out, self._said):
            stream.close()

    def _read_exactly(self, count: int) -> bytes:
        data = self._out.read(count)
        if len(data) != count:
            raise self._process_error()
        return data

    def _process_error(self) -> ResourceError:
        """Returns an error with the last line of output of the process, which explains why it ended."""
        self._worker.kill()
        self._worker.wait()
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        self.close()
        reason = lines[-1][:200] if lines else "the process ended without a message"
        return ResourceError(f"MediaPipe cannot run: {reason}", where="landmarks", remedy=_INSTALL_HINT)


def _parse_person(data: bytes) -> Landmarks:
    """Reads one person of the worker's output. A landmark with NaN values is not visible."""
    rows = np.frombuffer(data, "<f4").reshape(len(NAMES), 6).astype(np.float64)
    is_valid = np.asarray(np.isfinite(rows).all(1))
    rows = np.where(is_valid[:, None], rows, 0.0)
    return Landmarks(rows[:, :2], np.clip(rows[:, 2], 0.0, 1.0) * is_valid, rows[:, 3:])
