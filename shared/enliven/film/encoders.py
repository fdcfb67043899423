"""Lists the video encoders with their licences and options, and selects an encoder that works on this
machine."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import ModuleType

from enliven.errors import ResourceError


@dataclass(frozen=True)
class FilmEncoder:
    """An encoder: its FFmpeg name, the video format it writes, its licence, and its FFmpeg options."""

    name: str
    format: str
    licence: str
    options: dict[str, str] = field(default_factory=dict)


ENCODERS = (
    FilmEncoder("libx264", "H.264", "GPL-2.0-or-later", {"preset": "veryfast", "crf": "19"}),
    FilmEncoder("libopenh264", "H.264", "BSD-2-Clause"),
    FilmEncoder("h264_videotoolbox", "H.264", "the system's own"),
    FilmEncoder("h264_mf", "H.264", "the system's own"),
    FilmEncoder(
        "libvpx-vp9",
        "VP9",
        "BSD-3-Clause",
        {"deadline": "realtime", "cpu-used": "8", "row-mt": "1", "crf": "24"},
    ),
    FilmEncoder("mpeg4", "MPEG-4 part 2", "LGPL-2.1-or-later"),
)
"""Encoders in order of preference. H.264 plays everywhere, VP9 in browsers and most players, and MPEG-4 part
2 only in players. Encoders without options get a bit rate."""
AUTO = "auto"
"""The setting that selects the first of :data:`ENCODERS` that can be opened."""


def choose_encoder(av: ModuleType, size: tuple[int, int] = (1280, 720), requested: str = AUTO) -> FilmEncoder:
    """Returns the requested encoder, or the first encoder that can be opened for images of this size.

    Args:
        av: the module PyAV. It is a parameter, because this library does not depend on it.
        size: width and height in pixels, both even.
        requested: an encoder's name, or :data:`AUTO`.

    Raises:
        ResourceError: if no encoder can be opened.
    """
    for encoder in ENCODERS:
        if requested in (AUTO, encoder.name) and _can_open(av, encoder, size):
            return encoder
    if requested == AUTO:
        raise ResourceError(
            "the installed PyAV contains no film encoder",
            where="film",
            remedy="Install PyAV again: pip install av",
        )
    raise ResourceError(
        f"the film encoder {requested} is not available on this computer",
        where="film.encoder",
        remedy='Choose another encoder, or "auto" for the first available encoder.',
    )


def _can_open(av: ModuleType, encoder: FilmEncoder, size: tuple[int, int]) -> bool:
    """Returns True if the encoder can be opened.

    FFmpeg may list an encoder although its hardware or system library is missing.
    """
    if encoder.name not in av.codecs_available:
        return False
    try:
        context = av.CodecContext.create(encoder.name, "w")
        context.width, context.height = size
        context.pix_fmt, context.framerate, context.options = "yuv420p", 30, dict(encoder.options)
        context.open()
    except (av.error.FFmpegError, ValueError):
        return False
    return True
