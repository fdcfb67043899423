"""The sounds of the kiosk: a short chord when a visitor is noticed, takes a character, and leaves it."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from enliven.arrays import Int16
from enliven.sounds import SOUND_RATE

log = logging.getLogger(__name__)

CHORDS: Mapping[str, Sequence[float]] = {
    "noticed": (523.25, 659.26),
    "choose": (587.33,),
    "possessed": (523.25, 659.26, 783.99, 1046.5),
    "farewell": (783.99, 659.26, 523.25),
}
"""Frequencies in hertz of the notes of each sound, one after another."""
_NOTE_S = 0.13
"""Seconds between the starts of two notes."""
_RING_S = 0.9
"""Seconds for which a note rings."""
_DECAY_S = 0.18
"""Time constant in seconds of a note's exponential decay, like that of a chime."""
_VOLUME = 0.22
"""Amplitude of a note relative to the maximum, so that four of them do not clip."""


def make_sound(name: str) -> Int16:
    """Returns the samples of a sound, one channel at the rate of projects' sounds."""
    notes = CHORDS[name]
    length = round(((len(notes) - 1) * _NOTE_S + _RING_S) * SOUND_RATE)
    total = np.zeros(length)
    seconds = np.arange(round(_RING_S * SOUND_RATE)) / SOUND_RATE
    for k, frequency in enumerate(notes):
        begin = round(k * _NOTE_S * SOUND_RATE)
        attack = np.minimum(seconds / 0.008, 1.0)
        note = _VOLUME * attack * np.exp(-seconds / _DECAY_S) * np.sin(2 * np.pi * frequency * seconds)
        total[begin : begin + len(note)] += note[: length - begin]
    return np.asarray(np.rint(32767 * np.clip(total, -1.0, 1.0)), np.int16)


class CueSounds:
    """Plays the sounds of the story.

    Args:
        is_on: True if the profile asks for sounds. A computer without an audio output stays silent.
    """

    def __init__(self, is_on: bool) -> None:
        self._stream: Any = None
        self._playing: Int16 = np.zeros(0, np.int16)
        if is_on:
            self._open_output()
        self._sounds = {name: make_sound(name) for name in CHORDS} if self._stream is not None else {}

    def play(self, name: str) -> None:
        """Plays a sound from its start. Ignores an unknown or empty name."""
        if name in self._sounds:
            self._playing = self._sounds[name]

    def close(self) -> None:
        """Closes the audio output."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def fill(self, out: Int16, count: int, times: Any = None, fault: Any = None) -> None:
        """Writes the next samples into the array ``out`` (count, 1). The audio device's thread calls this
        method.
        """
        playing = self._playing
        ready = playing[:count]
        out[: len(ready), 0], out[len(ready) :, 0] = ready, 0
        if self._playing is playing:
            self._playing = playing[count:]

    def _open_output(self) -> None:
        """Opens the audio output. A failure is logged."""
        try:
            import sounddevice

            self._stream = sounddevice.OutputStream(
                samplerate=SOUND_RATE, channels=1, dtype="int16", callback=self.fill
            )
            self._stream.start()
        except Exception as error:  # PortAudio raises errors that are not OSErrors.
            self._stream = None
            log.warning("the kiosk plays no sounds, because the audio output cannot be opened: %s", error)
