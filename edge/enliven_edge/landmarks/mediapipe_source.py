"""Finds landmarks by MediaPipe's published package, in a process of its own."""

from __future__ import annotations

import struct
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enliven.arrays import UInt8
from enliven.errors import InputError, ResourceError
from enliven.settings import setting
from enliven_edge.landmarks.source import NAMES, Landmarks, LandmarkSource

_HEAD = struct.Struct("<IIq")
_PERSON_BYTES = len(NAMES) * 6 * 4
"""Bytes of one person in the worker's output: six float32 for each landmark."""
_MOST = 64
"""People in one image: a larger number from the worker is damage."""
_MEND = (
    "Either install the extra 'colour' and give the model's .task file, or give the Python of an environment "
    "with mediapipe 0.10.21, which brings its model."
)


@dataclass(frozen=True)
class MediaPipeSettings:
    """Where MediaPipe and its model are installed."""

    python: str = setting("", "The Python that has mediapipe; empty: the one that runs the edge.")
    model: str = setting("", "A pose landmarker's .task file; mediapipe up to 0.10.21 needs none.")


class MediaPipeSource(LandmarkSource):
    """A :class:`~enliven_edge.landmarks.source.LandmarkSource`; see :mod:`enliven_edge.landmarks.worker`.

    Raises:
        InputError: for a model file that does not exist.
        ResourceError: where MediaPipe cannot be started.
    """

    def __init__(self, settings: MediaPipeSettings | None = None) -> None:
        self.settings = settings or MediaPipeSettings()
        model = self.settings.model
        if model and not Path(model).is_file():
            raise InputError("there is no such model", where=model, mend="Give the path of a .task file.")
        command = [self.settings.python or sys.executable, str(Path(__file__).with_name("worker.py"))]
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 (closed by close)
        self._newest_ms = -1
        try:
            self._worker = subprocess.Popen(
                [*command, model] if model else command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
            )
        except OSError as error:
            self._said.close()
            raise ResourceError(
                f"it cannot be run ({error.strerror})", where=command[0], mend=_MEND
            ) from None
        assert self._worker.stdin is not None and self._worker.stdout is not None
        self._in, self._out = self._worker.stdin, self._worker.stdout
        if self._out.readline() != b"ready\n":
            raise self._failed()

    def find(self, colour: UInt8, time_ns: int) -> list[Landmarks]:
        height, width = colour.shape[:2]
        self._newest_ms = max(self._newest_ms + 1, time_ns // 1_000_000)
        try:
            self._in.write(_HEAD.pack(height, width, self._newest_ms))
            self._in.write(np.ascontiguousarray(colour, np.uint8).tobytes())
            self._in.flush()
            count = struct.unpack("<I", self._exactly(4))[0]
            if count > _MOST:
                raise self._failed()
            people = [self._exactly(_PERSON_BYTES) for _ in range(count)]
        except (BrokenPipeError, ValueError):
            raise self._failed() from None
        return [_landmarks(each) for each in people]

    def close(self) -> None:
        if self._worker.poll() is None:
            self._worker.terminate()
            self._worker.wait()
        for stream in (self._in, self._out, self._said):
            stream.close()

    def _exactly(self, count: int) -> bytes:
        data = self._out.read(count)
        if len(data) != count:
            raise self._failed()
        return data

    def _failed(self) -> ResourceError:
        """Returns the error that says why the process ended, by its last line of output."""
        self._worker.kill()
        self._worker.wait()
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        self.close()
        why = lines[-1][:200] if lines else "it ended without a word"
        return ResourceError(f"MediaPipe does not run: {why}", where="landmarks", mend=_MEND)


def _landmarks(data: bytes) -> Landmarks:
    """Reads one person of the worker's output; a landmark that is no number is not visible."""
    rows = np.frombuffer(data, "<f4").reshape(len(NAMES), 6).astype(np.float64)
    good = np.asarray(np.isfinite(rows).all(1))
    rows = np.where(good[:, None], rows, 0.0)
    return Landmarks(rows[:, :2], np.clip(rows[:, 2], 0.0, 1.0) * good, rows[:, 3:])
