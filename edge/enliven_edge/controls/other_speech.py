"""Recognises speech outside the list of phrases, so that a viewer can show the words that were heard."""

from __future__ import annotations

import importlib
from collections import deque
from collections.abc import Iterator
from typing import Any

from enliven.doctor import need

_STEP_BYTES = 960
"""Number of bytes decoded per call: 30 ms of sound. Decoding them takes about 15 ms, so the tracker is not
blocked."""
_MIN_SOUNDS = 3
"""Minimum number of phonemes in an utterance. Claps, thumps, tones and breath give at most two."""
_MAX_WAITING = 2
"""Maximum number of queued utterances. If the queue is full, the oldest are dropped, because the performer
keeps speaking."""


class OtherSpeech:
    """Transcribes utterances that the grammar of phrases rejected.

    A phoneme loop first separates speech from noise. Then the model of common English gives words. Each call
    of :meth:`decode_next_part` does a small part, because the library holds the interpreter lock.

    Raises:
        ResourceError: if pocketsphinx is not installed.
    """

    def __init__(self, where: str = "voice") -> None:
        need("pocketsphinx", "voice", where)
        sphinx: Any = importlib.import_module("pocketsphinx")
        self._decoder = sphinx.Decoder(loglevel="FATAL", bestpath=False, fwdflat=False, allphone_ci=True)
        self._words = str(self._decoder.current_search())
        self._decoder.add_allphone_file("sounds", sphinx.get_model_path("en-us/en-us-phone.lm.bin"))
        self._waiting: deque[bytes] = deque(maxlen=_MAX_WAITING)
        self._work: Iterator[str | None] | None = None

    @property
    def is_busy(self) -> bool:
        """Returns True if an utterance is queued or being recognised."""
        return bool(self._waiting) or self._work is not None

    def enqueue_utterance(self, sound: bytes) -> None:
        """Queues an utterance: 16-bit samples at 16 kHz."""
        self._waiting.append(sound)

    def decode_next_part(self) -> str | None:
        """Decodes the next part of a queued utterance.

        Returns the words of an utterance that is complete, None otherwise or for noise.
        """
        if self._work is None:
            if not self._waiting:
                return None
            self._work = self._recognise(self._waiting.popleft())
        try:
            return next(self._work)
        except StopIteration:
            self._work = None
            return None

    def forget(self) -> None:
        """Drops queued utterances, because the sound's source has changed."""
        self._waiting.clear()
        if self._work is not None:
            for _ in self._work:
                pass
            self._work = None

    def _recognise(self, sound: bytes) -> Iterator[str | None]:
        """Yields None while decoding, and finally the words if the sound is speech."""
        yield from self._decode("sounds", sound)
        sounds = [segment.word for segment in self._decoder.seg() or ()]
        if sum(phoneme.isalpha() and phoneme != "SIL" for phoneme in sounds) < _MIN_SOUNDS:
            return
        yield from self._decode(self._words, sound)
        hypothesis = self._decoder.hyp()
        if hypothesis is not None and hypothesis.hypstr.strip():
            yield str(hypothesis.hypstr).strip()

    def _decode(self, search: str, sound: bytes) -> Iterator[None]:
        self._decoder.activate_search(search)
        self._decoder.start_utt()
        for offset in range(0, len(sound), _STEP_BYTES):
            self._decoder.process_raw(sound[offset : offset + _STEP_BYTES], False, False)
            yield None
        self._decoder.end_utt()
