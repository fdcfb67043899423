"""Reads sound files into a project, to perform along with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from enliven.arrays import Int16
from enliven.errors import InputError
from enliven.sounds import SOUND_RATE, Sound
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor

SOUND_SUFFIXES = (".wav", ".mp3", ".ogg", ".flac", ".m4a")
"""File extensions of sound files."""
_MAX_DURATION_S = 1200.0
"""Maximum duration in seconds. A sound of this length takes 77 MB in a project."""


def read_sound(path: Path) -> Sound:
    """Returns the sound of a file, as one channel at :data:`SOUND_RATE`.

    Raises:
        InputError: if it is not a sound, is damaged before its first sample, or is longer than 20 minutes.
    """
    import av  # Imported here, because it takes 0.1 s to load.

    where = str(path)
    parts, count = list[Int16](), 0
    try:
        with av.open(where) as file:
            if not file.streams.audio:
                raise InputError(
                    tr("the file has no sound"),
                    where=where,
                    remedy=tr("Open a .wav, .mp3, .ogg or .flac file."),
                )
            for part in _read_samples(file, av.AudioResampler("s16", "mono", SOUND_RATE)):
                parts.append(part)
                count += len(part)
                if count > _MAX_DURATION_S * SOUND_RATE:
                    problem = tr("the sound is longer than {0:.0f} minutes", _MAX_DURATION_S / 60)
                    raise InputError(
                        problem, where=where, remedy=tr("Shorten the sound to the part that you need.")
                    )
    except (av.FFmpegError, OSError):
        if not count:
            problem = tr("the file cannot be read as sound")
            raise InputError(problem, where=where, remedy=tr("Save the sound as .wav.")) from None
    if not count:
        raise InputError(
            tr("the file contains no sound"), where=where, remedy=tr("Save the sound again as .wav.")
        )
    return Sound(path.stem, np.concatenate(parts))


def add_sound(editor: Editor, path: Path, read: Sound) -> None:
    """Adds a sound to perform along with. It begins at the playhead and replaces an existing sound."""
    sound = replace(read, begin=editor.time)
    if editor.edit(later("open {0}", path.name), lambda project: replace(project, sounds={sound.id: sound})):
        editor.toasts.show_message(
            tr("{0} begins here", path.name), tr("The sound plays during playback and recording.")
        )


def _read_samples(file: Any, resampler: Any) -> Iterator[Int16]:
    """Yields (N,) int16 samples until the file ends or a damaged part begins."""
    for frame in file.decode(file.streams.audio[0]):
        for resampled in resampler.resample(frame):
            yield resampled.to_ndarray()[0]
    for resampled in resampler.resample(None):
        yield resampled.to_ndarray()[0]
