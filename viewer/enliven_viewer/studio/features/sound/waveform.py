"""The waveform of a sound along the timeline's ruler."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven.arrays import Float32
from enliven.sounds import SOUND_RATE, Sound
from enliven_viewer.studio.app.style import pack_colour, use_small_text
from enliven_viewer.studio.app.time_axis import LABEL_WIDTH, RULER_HEIGHT, TimeAxis
from enliven_viewer.theme import ACCENT, INK

_WAVEFORM_LINE_WIDTH = 2.0
"""Width in pixels of a line of a sound's waveform."""
_MAX_SAMPLE = 32767
"""The largest 16-bit sample."""


def compute_envelope(sound: Sound, begin: float, end: float, columns: int) -> Float32:
    """Returns the peak levels (columns,), 0 to 1, in equal intervals of the project's time from ``begin`` to
    ``end`` seconds.
    """
    edges = np.linspace(begin - sound.begin, end - sound.begin, columns + 1) * SOUND_RATE
    edges = np.clip(np.round(edges), 0, len(sound.samples)).astype(np.int64)
    loud = np.zeros(columns, np.float32)
    filled = np.flatnonzero(edges[1:] > edges[:-1])
    if len(filled):
        part = np.abs(sound.samples[edges[filled[0]] : edges[filled[-1] + 1]].astype(np.int32))
        starts = edges[filled] - edges[filled[0]]
        loud[filled] = np.maximum.reduceat(part, starts) / _MAX_SAMPLE
    return loud


def draw_sounds(axis: TimeAxis, origin: tuple[float, float], *, is_on: bool) -> None:
    """Draws the waveforms of the sounds along the ruler, with their names at the left. Muted
    sounds are pale.
    """
    left, top = origin
    draw_list, sounds = imgui.get_window_draw_list(), axis.editor.project.sounds
    first, last, scale = LABEL_WIDTH, axis.width, axis.scale
    count = int((last - first) / _WAVEFORM_LINE_WIDTH)
    if not sounds or count < 1:
        return
    middle, tint = top + RULER_HEIGHT / 2, pack_colour(ACCENT, 0.5 if is_on else 0.2)
    for sound in sounds.values():
        loud = compute_envelope(
            sound, scale.time(first), scale.time(first + count * _WAVEFORM_LINE_WIDTH), count
        )
        for column in np.flatnonzero(loud):
            x, height = (
                left + first + column * _WAVEFORM_LINE_WIDTH,
                max(loud[column] * (RULER_HEIGHT / 2 - 2), 0.5),
            )
            draw_list.add_line(
                ImVec2(x, middle - height), ImVec2(x, middle + height), tint, _WAVEFORM_LINE_WIDTH
            )
    with use_small_text():
        name = f"\uf001  {', '.join(sounds)}"
        draw_list.add_text(ImVec2(left + 8, top + 5), pack_colour(INK, 0.9), name)
