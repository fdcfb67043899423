"""The sound of spoken commands: from a microphone, or from a recording for rehearsals."""

from __future__ import annotations

import importlib
import time
import wave
from collections.abc import Callable
from pathlib import Path
from typing import Any

from enliven.errors import InputError, ResourceError
from enliven_edge.extras import need

RATE = 16000
"""Samples a second, of 16 bits, one channel: the speech model was trained on these."""


class SoundRecording:
    """Plays a WAV file in its own time in place of a microphone, for rehearsals.

    Args:
        sleep: waits until a frame is due.
    """

    def __init__(self, path: Path, sleep: Callable[[float], None] = time.sleep) -> None:
        self._path, self._sleep = path, sleep
        self._sound, self._place, self._bytes, self._began = b"", 0, 0, 0.0

    def open(self, frame_bytes: int) -> None:
        """Opens the file at its beginning.

        Raises:
            InputError: where it is no 16 kHz mono WAV of 16 bits.
            OSError: where it cannot be read.
        """
        try:
            with wave.open(str(self._path), "rb") as file:
                given = (file.getframerate(), file.getnchannels(), file.getsampwidth())
                self._sound = file.readframes(file.getnframes())
        except (wave.Error, EOFError) as error:
            raise InputError(f"it is no WAV file ({error})", where=str(self._path)) from None
        if given != (RATE, 1, 2):
            what = f"it has {given[0]} Hz, {given[1]} channels, {8 * given[2]} bits"
            raise InputError(what, where=str(self._path), mend="It must have 16000 Hz, 1 channel, 16 bits.")
        self._sound += bytes(RATE * 2)  # a second of silence ends the last phrase
        self._place, self._bytes, self._began = 0, frame_bytes, time.monotonic()

    def read(self) -> bytes:
        """Returns the next frame when it is due; raises EOFError at the end."""
        frame = self._sound[self._place : self._place + self._bytes]
        if len(frame) < self._bytes:
            raise EOFError
        self._place += self._bytes
        self._sleep(max(0.0, self._began + self._place / (2 * RATE) - time.monotonic()))
        return frame

    def close(self) -> None:
        """Does nothing: no device is open."""


class Microphone:
    """A microphone by PortAudio.

    Args:
        name: part of its name, or empty for the system's own.

    Raises:
        ResourceError: where sounddevice or PortAudio is missing.
    """

    def __init__(self, name: str, where: str) -> None:
        need("sounddevice", "voice", where)
        try:
            self._library: Any = importlib.import_module("sounddevice")
        except OSError as error:
            mend = "Install it: sudo apt-get install libportaudio2."
            raise ResourceError(f"PortAudio is missing ({error})", where=where, mend=mend) from None
        self._name = name
        self._stream: Any = None
        self._samples, self._opened = 0, False

    def open(self, frame_bytes: int) -> None:
        """Opens the microphone; raises PortAudio's own error where there is none."""
        if self._opened:
            # PortAudio lists the devices once; only a new start finds what was plugged in since.
            self._library._terminate()
            self._library._initialize()
        self._opened = True
        self._samples = frame_bytes // 2
        self._stream = self._library.RawInputStream(
            samplerate=RATE, channels=1, dtype="int16", blocksize=self._samples, device=self._name or None
        )
        self._stream.start()

    def read(self) -> bytes:
        """Returns the next frame when it is complete."""
        data, _ = self._stream.read(self._samples)
        return bytes(data)

    def close(self) -> None:
        """Releases the microphone."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None
