"""Recognises spoken commands offline: PocketSphinx listens for a few phrases only, live or in a recording."""

from __future__ import annotations

import importlib
import logging
import time
import wave
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from enliven.errors import InputError, ResourceError
from enliven_edge.controls.base import Device
from enliven_edge.controls.settings import ControlSettings
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
        except (wave.Error, EOFError):
            raise InputError("it is no WAV file", where=str(self._path)) from None
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


log = logging.getLogger(__name__)

_LONGEST = 3.0
"""Seconds of an utterance: a longer one is no command."""
_TALK = (
    "the a and you to of that it is what in we me this was for are have do not be on your with my all can "
    "will one there so just about out up if now then time look did could please hello yes no stop go come "
    "here more once again next week left right over who why"
)
"""Words that begin ordinary talk: an utterance that begins with no phrase's first word is talk."""


class Recogniser:
    """Recognises phrases in sound, by a grammar of the phrases and of ordinary talk.

    A phrase counts where the whole of what was said between two silences is it. Sound is decoded while it
    comes in, a few milliseconds at a time, so that the tracker beside it does not wait. Posterior
    probabilities are not asked for: their lattice takes up to seconds, and the talk tells better.

    Args:
        phrases: lower case words, such as "puppet take it".
        where: for errors.

    Raises:
        InputError: for a word that is not in the model's dictionary.
        ResourceError: where pocketsphinx is not installed.
    """

    def __init__(self, phrases: Sequence[str], where: str = "voice") -> None:
        need("pocketsphinx", "voice", where)
        sphinx: Any = importlib.import_module("pocketsphinx")
        self._phrases = frozenset(phrases)
        self._decoder = sphinx.Decoder(lm=None, loglevel="FATAL", bestpath=False)
        for word in sorted({word for phrase in phrases for word in phrase.split()}):
            if not word.isascii() or self._decoder.lookup_word(word) is None:
                what, mend = (
                    f"the model does not know the word {word!r}",
                    "Say it with English words, lower case.",
                )
                raise InputError(what, where=where, mend=mend)
        self._decoder.add_jsgf_string("commands", _grammar(phrases))
        self._decoder.activate_search("commands")
        self._ends = sphinx.Endpointer()
        self._bytes = 0

    @property
    def frame_bytes(self) -> int:
        """Bytes of sound that :meth:`feed` takes at once."""
        return int(self._ends.frame_bytes)

    def feed(self, frame: bytes) -> str | None:
        """Returns the phrase that ended with this frame, or None.

        Args:
            frame: :attr:`frame_bytes` of sound at :data:`RATE`.
        """
        before = self._ends.in_speech
        speech = self._ends.process(frame)
        if self._ends.in_speech and not before:
            self._decoder.start_utt()
            self._bytes = 0
        if speech is not None:
            self._bytes += len(speech)
            if self._bytes < _LONGEST * RATE * 2:
                self._decoder.process_raw(speech, False, False)
        if before and not self._ends.in_speech:
            return self._ended()
        return None

    def forget(self) -> None:
        """Resets the state after the sound's source changed: an unfinished utterance is dropped."""
        if self._ends.in_speech:
            self._decoder.end_utt()
        self._ends = type(self._ends)()

    def _ended(self) -> str | None:
        """Returns the utterance since the last silence, if it is a phrase."""
        self._decoder.end_utt()
        found = self._decoder.hyp()
        if found is None or self._bytes >= _LONGEST * RATE * 2:
            return None
        log.debug("heard %r", found.hypstr)
        return str(found.hypstr) if found.hypstr in self._phrases else None


def _grammar(phrases: Sequence[str]) -> str:
    """Returns the phrases in the JSpeech Grammar Format, and similar talk with other first words.

    A grammar must find something in whatever is said. Talk finds what begins otherwise.
    """
    names = {phrase.split()[0] for phrase in phrases}
    rests = sorted({" ".join(phrase.split()[1:]) for phrase in phrases} - {""})
    rest = f"[{' | '.join(rests)}]" if rests else ""
    return (
        "#JSGF V1.0; grammar commands;"
        f"public <command> = {' | '.join(phrases)} | <talk> [<talk>] {rest};"
        f"<talk> = {' | '.join(word for word in _TALK.split() if word not in names)};"
    )


class Voice(Device):
    """Listens to a microphone, or a recording in its place, for phrases.

    Raises:
        InputError: for a phrase with an unknown word.
        ResourceError: where a library is missing.
    """

    def __init__(
        self, settings: ControlSettings, phrases: Sequence[str], where: str, folder: Path | None = None
    ) -> None:
        self._recogniser = Recogniser(phrases, where)
        self._source: SoundRecording | Microphone
        if settings.wav:
            self._source = SoundRecording((folder or Path()) / settings.wav)
        else:
            self._source = Microphone(settings.microphone, where)

    def open(self) -> None:
        self._recogniser.forget()
        self._source.open(self._recogniser.frame_bytes)

    def read(self) -> list[str]:
        phrase = self._recogniser.feed(self._source.read())
        return [] if phrase is None else [phrase]

    def close(self) -> None:
        self._source.close()
