"""Plays a project's sounds in the background, in sync with its playhead."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from enliven.arrays import Int16
from enliven.sounds import SOUND_RATE, Sound, mix_sounds
from enliven_viewer.language import tr
from enliven_viewer.studio.editor.editor import Editor

_MAX_OFFSET_S = 0.08
"""Maximum time difference between sound and image in seconds. People notice a larger delay."""


class Stream(Protocol):
    """An audio output that requests samples in a separate thread."""

    latency: float

    def close(self) -> None:
        """Closes the output."""


FillSamples = Callable[[Any, int, Any, Any], None]
"""A function that writes the next N samples into an int16 array (N, 1). Its arguments are the array, N, and
the device's times and fault flags.
"""


def open_default_device(fill: FillSamples) -> Stream:
    """Returns the computer's default audio output.

    Raises:
        ImportError: if sounddevice is not installed.
        OSError: if PortAudio is not installed.
        Exception: an error of PortAudio, if no device can play.
    """
    import sounddevice

    stream = sounddevice.OutputStream(samplerate=SOUND_RATE, channels=1, dtype="int16", callback=fill)
    stream.start()
    return stream  # type: ignore[no-any-return]


class SoundPlayer:
    """A player of a project's sounds, active while the project plays at normal speed.

    Args:
        opened: a function that opens the audio output.

    Attributes:
        is_on: whether sound is on.
    """

    def __init__(self, editor: Editor, opened: Callable[[FillSamples], Stream] = open_default_device) -> None:
        self.editor, self._opened = editor, opened
        self.is_on = True
        self._stream: Stream | None = None
        self._sounds: tuple[Sound, ...] = ()
        self._next = 0  # Index of the project's sample that the device requests next.
        self._failed = False

    def toggle(self) -> None:
        """Turns the sound on or off. Turning it on opens a failed device again."""
        self.is_on, self._failed = not self.is_on, False

    def synchronise(self) -> None:
        """Synchronises with the editor. Call once per frame."""
        editor = self.editor
        self._sounds = tuple(editor.project.sounds.values())
        plays = editor.playing and editor.speed == 1.0 and not editor.scrubbing
        if not (self._sounds and self.is_on and plays) or self._failed:
            self.stop()
            return
        if self._stream is None:
            self._next = round(editor.time * SOUND_RATE)
            self._stream = self._open_output()
        if self._stream is not None:
            # The device plays the requested samples after its latency, so write the samples for that time.
            wanted_sample = round((editor.time + self._stream.latency) * SOUND_RATE)
            if abs(wanted_sample - self._next) > _MAX_OFFSET_S * SOUND_RATE:
                self._next = wanted_sample

    def stop(self) -> None:
        """Stops the sound."""
        if self._stream is not None:
            self._stream.close()
        self._stream = None

    def _open_output(self) -> Stream | None:
        """Opens the audio output. On failure reports it once, and the project plays silently."""
        try:
            return self._opened(self._fill_samples)
        except Exception as error:  # PortAudio raises errors that are not OSErrors.
            self._failed = True
            lacks = f"({str(error).splitlines()[0][:80]})" if str(error) else ""
            remedy = tr(
                'Install sound: pip install "./viewer[sound]", and libportaudio2. Or plug in a sound device.'
            )
            self.editor.toasts.show_message(tr("The sound cannot be played here {0}", lacks), remedy)
            return None

    def _fill_samples(self, out: Int16, count: int, times: Any, fault: Any) -> None:
        """Writes the next samples. The audio device's thread calls this method."""
        first, self._next = self._next, self._next + count
        out[:, 0] = mix_sounds(self._sounds, first, count)
