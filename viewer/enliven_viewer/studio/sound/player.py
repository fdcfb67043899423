"""Plays a project's sounds in the background, in step with its playhead."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from enliven.arrays import Int16
from enliven.sounds import SOUND_RATE, Sound, mixed
from enliven_viewer.language import tr
from enliven_viewer.studio.editor import Editor

_APART = 0.08
"""Seconds by which sound and picture may differ: twice what is noticed would be heard as late."""


class Stream(Protocol):
    """What asks for samples, in a separate thread."""

    latency: float

    def close(self) -> None:
        """Ends it."""


Fill = Callable[[Any, int, Any, Any], None]
"""Writes the next samples into an array (N, 1) of int16; N, and what the device says of times and faults."""


def device(fill: Fill) -> Stream:
    """Returns the machine's own output.

    Raises:
        ImportError: if sounddevice is not installed.
        OSError: if PortAudio is not installed.
        Exception: of PortAudio, where nothing can play.
    """
    import sounddevice

    stream = sounddevice.OutputStream(samplerate=SOUND_RATE, channels=1, dtype="int16", callback=fill)
    stream.start()
    return stream  # type: ignore[no-any-return]


class SoundPlayer:
    """Lets the sounds of a project be heard while it plays at its own speed.

    Args:
        opened: opens what plays.

    Attributes:
        heard: whether they are to be heard.
    """

    def __init__(self, editor: Editor, opened: Callable[[Fill], Stream] = device) -> None:
        self.editor, self._opened = editor, opened
        self.heard = True
        self._stream: Stream | None = None
        self._sounds: tuple[Sound, ...] = ()
        self._next = 0  # the sample of the project's time that is asked for next
        self._failed = False

    def toggle(self) -> None:
        """Lets them be heard, or not; a device that failed is tried again."""
        self.heard, self._failed = not self.heard, False

    def follow(self) -> None:
        """Keeps step with the editor; to be called once per frame."""
        editor = self.editor
        self._sounds = tuple(editor.project.sounds.values())
        plays = editor.playing and editor.speed == 1.0 and not editor.scrubbing
        if not (self._sounds and self.heard and plays) or self._failed:
            self.stop()
            return
        if self._stream is None:
            self._next = round(editor.time * SOUND_RATE)
            self._stream = self._begin()
        if self._stream is not None:
            # What is asked for now is heard once it has gone through the device.
            wanted = round((editor.time + self._stream.latency) * SOUND_RATE)
            if abs(wanted - self._next) > _APART * SOUND_RATE:
                self._next = wanted

    def stop(self) -> None:
        """Ends the sound."""
        if self._stream is not None:
            self._stream.close()
        self._stream = None

    def _begin(self) -> Stream | None:
        """Opens what plays; where that fails it is said once, and the project plays on in silence."""
        try:
            return self._opened(self._fill)
        except Exception as error:  # PortAudio's own errors are no OSErrors
            self._failed = True
            lacks = f"({str(error).splitlines()[0][:80]})" if str(error) else ""
            mend = tr('Install it with pip install "./viewer[sound]" and libportaudio2, or plug in a device.')
            self.editor.toasts.say(tr("The sound cannot be heard here {0}", lacks), mend)
            return None

    def _fill(self, out: Int16, count: int, times: Any, fault: Any) -> None:
        """Writes the next samples; called by the device's thread."""
        first, self._next = self._next, self._next + count
        out[:, 0] = mixed(self._sounds, first, count)
