"""Recognises spoken commands offline: PocketSphinx listens for a few phrases only."""

from __future__ import annotations

import importlib
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from enliven.errors import InputError
from enliven_edge.controls.base import Device
from enliven_edge.controls.settings import ControlSettings
from enliven_edge.controls.sound import RATE, Microphone, SoundRecording
from enliven_edge.extras import need

log = logging.getLogger(__name__)

_LONGEST = 3.0
"""Seconds of an utterance: a longer one is no command."""
_TALK = (
    "the a and you to of that it is what in we me this was for are have do not be on your with my all can "
    "will one there so just about out up if now then time look did could please hello yes no stop go come "
    "here more once again next week left right over who why"
)
"""Words that begin ordinary talk: an utterance that does not begin with a phrase's first word is recognised
as talk."""


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

    A grammar must find something in whatever is said. Talk finds the phrases that begin otherwise, which
    are no commands.
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
