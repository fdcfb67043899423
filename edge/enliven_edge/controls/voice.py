"""Recognises spoken commands offline: PocketSphinx listens for a few phrases only, live or in a recording."""

from __future__ import annotations

import importlib
import logging
import time
import wave
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from enliven.doctor import need
from enliven.errors import InputError, ResourceError
from enliven_edge.controls.base import Device
from enliven_edge.controls.other_speech import OtherSpeech
from enliven_edge.controls.settings import ControlSettings

RATE = 16000
"""Samples per second, 16 bits, one channel: the format that the speech model was trained on."""


class SoundRecording:
    """Plays a WAV file in real time instead of a microphone, for rehearsals.

    Args:
        sleep: function that waits for a number of seconds, until a frame is due.
    """

    def __init__(self, path: Path, sleep: Callable[[float], None] = time.sleep) -> None:
        self._path, self._sleep = path, sleep
        self._sound, self._offset, self._bytes, self._started_at = b"", 0, 0, 0.0

    def open(self, frame_bytes: int) -> None:
        """Opens the file at its beginning.

        Raises:
            InputError: if it is not a 16 kHz mono WAV file of 16 bits.
            OSError: if it cannot be read.
        """
        try:
            with wave.open(str(self._path), "rb") as file:
                audio_format = (file.getframerate(), file.getnchannels(), file.getsampwidth())
                self._sound = file.readframes(file.getnframes())
        except (wave.Error, EOFError):
            raise InputError("the file is not a WAV file", where=str(self._path)) from None
        if audio_format != (RATE, 1, 2):
            problem = (
                f"the file has {audio_format[0]} Hz, {audio_format[1]} channels, {8 * audio_format[2]} bits"
            )
            raise InputError(
                problem, where=str(self._path), remedy="Convert the file to 16000 Hz, 1 channel, 16 bits."
            )
        self._sound += bytes(RATE * 2)  # Append a second of silence, which ends the last phrase.
        self._offset, self._bytes, self._started_at = 0, frame_bytes, time.monotonic()

    def read(self) -> bytes:
        """Returns the next frame when it is due. Raises EOFError at the end."""
        frame = self._sound[self._offset : self._offset + self._bytes]
        if len(frame) < self._bytes:
            raise EOFError
        self._offset += self._bytes
        self._sleep(max(0.0, self._started_at + self._offset / (2 * RATE) - time.monotonic()))
        return frame

    def close(self) -> None:
        """Does nothing: no device is open."""


class Microphone:
    """A microphone, opened by PortAudio.

    Args:
        name: a part of the microphone's name, or empty for the system's default.

    Raises:
        ResourceError: if sounddevice or PortAudio is missing.
    """

    def __init__(self, name: str, where: str) -> None:
        need("sounddevice", "voice", where)
        try:
            self._library: Any = importlib.import_module("sounddevice")
        except OSError as error:
            remedy = "Install PortAudio: sudo apt-get install libportaudio2."
            raise ResourceError(f"PortAudio is missing ({error})", where=where, remedy=remedy) from None
        self._name = name
        self._stream: Any = None
        self._samples, self._opened = 0, False

    def open(self, frame_bytes: int) -> None:
        """Opens the microphone.

        Raises:
            ResourceError: if none is found, or another program uses it.
        """
        if self._opened:
            # PortAudio lists the devices only once. It must be restarted to find devices that were plugged in
            # later.
            self._library._terminate()
            self._library._initialize()
        self._opened = True
        self._samples = frame_bytes // 2
        try:
            self._stream = self._library.RawInputStream(
                samplerate=RATE, channels=1, dtype="int16", blocksize=self._samples, device=self._name or None
            )
            self._stream.start()
        except (ValueError, self._library.PortAudioError) as error:
            raise self._open_failure() from error

    def _open_failure(self) -> ResourceError:
        """Returns an error with the reason why the microphone cannot be opened, in words for users."""
        inputs = [
            str(device["name"])
            for device in self._library.query_devices()
            if device["max_input_channels"] > 0
        ]
        if not inputs:
            return ResourceError(
                "no microphone is connected",
                where="voice",
                remedy="Plug in a microphone. The edge detects it automatically.",
            )
        if self._name and not any(self._name.lower() in input_name.lower() for input_name in inputs):
            remedy = f"Set microphone to one of these names, or to a part of one: {', '.join(inputs)}."[:160]
            return ResourceError(
                f"no microphone is called {self._name!r}"[:160], where="voice", remedy=remedy
            )
        remedy = (
            "Close other programs that use the microphone, or choose another microphone in the sound "
            "settings."
        )
        return ResourceError("the microphone cannot be opened", where="voice", remedy=remedy)

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

_MAX_UTTERANCE_S = 3.0
"""Maximum seconds of an utterance. A longer utterance is not a command."""
_TALK_WORDS = (
    "the a and you to of that it is what in we me this was for are have do not be on your with my all can "
    "will one there so just about out up if now then time look did could please hello yes no stop go come "
    "here more once again next week left right over who why"
)
"""First words of ordinary talk. They model utterances that do not start with a phrase's first word, which
count as talk."""
_ACTION_WORDS = (
    "turn move dance run play sit lie down arm head hand body man day thing water house big small new good "
    "long little first great old work way people place back make take give tell find see want need know think"
)
"""Common words that may follow a name. They model speech to the puppet that matches no phrase."""
_OTHER_SPEECH_WEIGHT = 1e-4
"""Weight in the grammar of a name followed by other words, relative to a phrase. With a larger weight,
phrases are taken for other speech."""


class Recogniser:
    """Recognises phrases in sound, by a grammar of the phrases and of ordinary talk.

    A phrase counts if it is the whole utterance between two silences. Sound is decoded as it arrives, a few
    milliseconds at a time, so that the tracker is not blocked. Posterior probabilities are not computed,
    because their lattice takes up to seconds, and the model of talk separates better.

    Args:
        phrases: lower case words, such as "puppet take it".
        where: the setting that error messages name.
        other: recogniser of other speech. If None, one is created, which takes a second.

    Raises:
        InputError: for a word that is not in the model's dictionary.
        ResourceError: if pocketsphinx is not installed.
    """

    def __init__(
        self, phrases: Sequence[str], where: str = "voice", other: OtherSpeech | None = None
    ) -> None:
        need("pocketsphinx", "voice", where)
        sphinx: Any = importlib.import_module("pocketsphinx")
        self._phrases = frozenset(phrases)
        self._decoder = sphinx.Decoder(lm=None, loglevel="FATAL", bestpath=False)
        for word in sorted({word for phrase in phrases for word in phrase.split()}):
            if not word.isascii() or self._decoder.lookup_word(word) is None:
                problem, remedy = (
                    f"the speech model does not know the word {word!r}",
                    "Use only English words in lower case in the phrases.",
                )
                raise InputError(problem, where=where, remedy=remedy)
        self._decoder.add_jsgf_string("commands", _build_grammar(phrases))
        self._decoder.activate_search("commands")
        self._ends = sphinx.Endpointer()
        self._bytes = 0
        self._utterance = bytearray()
        self._other = other or OtherSpeech(where)
        self._not_understood: list[str] = []

    @property
    def frame_bytes(self) -> int:
        """The number of bytes of sound that :meth:`feed` expects per call."""
        return int(self._ends.frame_bytes)

    def feed(self, frame: bytes) -> str | None:
        """Returns the phrase that ended with this frame, or None.

        Args:
            frame: :attr:`frame_bytes` of sound at :data:`RATE`.
        """
        self.decode_next_part()
        was_in_speech = self._ends.in_speech
        speech = self._ends.process(frame)
        if self._ends.in_speech and not was_in_speech:
            self._decoder.start_utt()
            self._bytes = 0
            self._utterance.clear()
        if speech is not None:
            self._bytes += len(speech)
            if self._bytes < _MAX_UTTERANCE_S * RATE * 2:
                self._decoder.process_raw(speech, False, False)
                self._utterance += speech
        if was_in_speech and not self._ends.in_speech:
            return self._take_phrase()
        return None

    @property
    def is_busy(self) -> bool:
        """Returns True while other speech is still being recognised."""
        return self._other.is_busy

    def decode_next_part(self) -> None:
        """Continues the recognition of other speech. :meth:`feed` does this, too."""
        if (words := self._other.decode_next_part()) is not None:
            self._not_understood.append(words)

    def take_not_understood(self) -> list[str]:
        """Returns the words of short utterances since the last call that matched no phrase."""
        words, self._not_understood = self._not_understood, []
        return words

    def forget(self) -> None:
        """Resets the state after the sound's source changed. An unfinished utterance is dropped."""
        self._other.forget()
        if self._ends.in_speech:
            self._decoder.end_utt()
        self._ends = type(self._ends)()

    def _take_phrase(self) -> str | None:
        """Returns the utterance since the last silence if it is a phrase, else None."""
        self._decoder.end_utt()
        hypothesis = self._decoder.hyp()
        if self._bytes >= _MAX_UTTERANCE_S * RATE * 2:
            return None
        if hypothesis is not None and hypothesis.hypstr in self._phrases:
            log.debug("heard %r", hypothesis.hypstr)
            return str(hypothesis.hypstr)
        self._other.enqueue_utterance(bytes(self._utterance))
        return None


def _build_grammar(phrases: Sequence[str]) -> str:
    """Returns a grammar of the phrases and of ordinary talk in the JSpeech Grammar Format.

    A grammar always finds a match. ``talk`` matches utterances that start with other words. A name followed
    by other words matches speech to the puppet that is not a phrase.
    """
    names = sorted({phrase.split()[0] for phrase in phrases})
    continuations = sorted({" ".join(phrase.split()[1:]) for phrase in phrases} - {""})
    any_words = f"[{' | '.join(continuations)}]" if continuations else ""
    talk = [word for word in _TALK_WORDS.split() if word not in names]
    followers = {any_words.split()[0] for any_words in continuations}
    others = [word for word in dict.fromkeys((*talk, *_ACTION_WORDS.split())) if word not in followers]
    alternatives = " | ".join(f"/1.0/ {phrase}" for phrase in phrases)
    return (
        "#JSGF V1.0; grammar commands;"
        f"public <command> = {alternatives} | /1.0/ <talk> [<talk>] {any_words} | "
        f"/{_OTHER_SPEECH_WEIGHT}/ <name> <other> [<other>] [<other>];"
        f"<name> = {' | '.join(names)};"
        f"<other> = {' | '.join(others)};"
        f"<talk> = {' | '.join(talk)};"
    )


class Voice(Device):
    """Listens for phrases to a microphone or a recording.

    Raises:
        InputError: for a phrase with an unknown word.
        ResourceError: if a library is missing.
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
        """Opens the microphone or the recording. An unfinished utterance is dropped."""
        self._recogniser.forget()
        self._source.open(self._recogniser.frame_bytes)

    def read(self) -> list[str]:
        """Reads one frame of sound. Returns the phrase that ended with it, if there is one.

        After the end of a recording, each call decodes a part of the last utterance.

        Raises:
            EOFError: if the recording has ended and everything is decoded.
        """
        try:
            frame = self._source.read()
        except EOFError:
            if not self._recogniser.is_busy:
                raise
            self._recogniser.decode_next_part()  # Wait for the last words of the recording.
            return []
        phrase = self._recogniser.feed(frame)
        return [] if phrase is None else [phrase]

    def take_unrecognised_words(self) -> list[str]:
        """Returns the utterances since the last call that are none of the phrases."""
        return self._recogniser.take_not_understood()

    def close(self) -> None:
        """Releases the microphone or the recording."""
        self._source.close()
