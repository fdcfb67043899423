"""Writes images and sound to an MP4 file with PyAV, as H.264 and AAC if these encoders exist."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from enliven.arrays import Int16, UInt8
from enliven.errors import ResourceError
from enliven.files import replace_file
from enliven.film.encoders import AUTO, choose_encoder

log = logging.getLogger(__name__)

_SOUND_CODEC = "aac"
"""Name of the sound encoder. Every player supports its format."""
_SOUND_BIT_RATE = 128_000
"""Bit rate of sound in bits per second. It is more than enough for one channel of music."""


_OTHER_PLACE_ADVICE = "Choose another folder or name for the film."
"""The remedy if a film cannot be written."""


class _Abandoned(Exception):
    """An internal exception that ends the writing of a file that must not replace its target."""


class FilmWriter:
    """An MP4 file that is written image by image and replaces ``path`` when it is complete.

    Leaving the ``with`` block completes the file. If it contains no images, or an error occurred, the
    existing file stays. Ctrl-C also completes the file, because this is the usual end of films of a live
    sensor.

    Args:
        path: path of the .mp4 file. Its folder is created.
        size: width and height in pixels, or None for the size of the first image. If width or height is odd,
            the last column or row is cut off, because 4:2:0 requires even sizes.
        rate: images per second.
        bit_rate: bit rate in Mbit/s, for encoders without a quality option.
        encoder: the name of one of :data:`enliven.film.encoders.ENCODERS`, or "auto".
        sound: (N,) samples of one channel, and the sample rate. The sound starts with the first image and
            ends with the last image.

    Raises:
        ResourceError: if PyAV is missing, the file cannot be written, or the encoder does not exist.
    """

    def __init__(
        self,
        path: Path,
        size: tuple[int, int] | None,
        rate: float,
        bit_rate: float,
        encoder: str = AUTO,
        sound: tuple[Int16, int] | None = None,
    ) -> None:
        self._av = _import_pyav()
        self.path, self.count, self.codec = path, 0, ""
        self._rate, self._bit_rate, self._encoder = Fraction(rate).limit_denominator(1001), bit_rate, encoder
        self._sound, self._sound_end = sound, 0
        self._sound_stream: Any = None
        if size is not None:
            self._choose_encoder(size)
        self._scope = ExitStack()
        with self._explain_error():
            path.parent.mkdir(parents=True, exist_ok=True)
            part = self._scope.enter_context(replace_file(path, _OTHER_PLACE_ADVICE))
            self._file = self._av.open(str(part), "w", format="mp4", options={"movflags": "+faststart"})

    @contextmanager
    def _explain_error(self) -> Iterator[None]:
        """Converts an operating system error to a ResourceError with the film's path. Removes the unfinished
        file.
        """
        try:
            yield
        except OSError as error:
            self._remove_unfinished()
            problem = f"the film cannot be written ({error.strerror})"
            raise ResourceError(problem, where=str(self.path), remedy=_OTHER_PLACE_ADVICE) from None

    def _remove_unfinished(self) -> None:
        """Removes the unfinished file. The existing file stays."""
        with suppress(_Abandoned, OSError), self._scope:
            raise _Abandoned

    def _choose_encoder(self, size: tuple[int, int]) -> None:
        """Chooses the encoder for images of a size."""
        self.width, self.height = size[0] // 2 * 2, size[1] // 2 * 2
        chosen = choose_encoder(self._av, (self.width, self.height), self._encoder)
        self.codec, self._options = chosen.name, dict(chosen.options)
        if self._encoder == AUTO and chosen.format != "H.264":
            log.warning("no H.264 encoder was found, so %s is encoded as %s", self.path, chosen.format)

    def _begin_video(self) -> None:
        """Adds the video stream to the file."""
        self._stream = self._file.add_stream(self.codec, rate=self._rate, options=self._options)
        self._stream.width, self._stream.height = self.width, self.height
        self._stream.pix_fmt = "yuv420p"
        if not self._options:
            self._stream.bit_rate = int(self._bit_rate * 1e6)
        if self._sound is not None and len(self._sound[0]):
            self._begin_sound(self._sound[1])

    def _begin_sound(self, rate: int) -> None:
        """Adds the sound stream to the file. Call it before the first packet is written."""
        try:
            stream = self._file.add_stream(_SOUND_CODEC, rate=rate)
        except (ValueError, self._av.FFmpegError):  # PyAV may have been built without this codec.
            log.warning("no sound encoder was found, so %s has no sound", self.path)
            return
        stream.layout, stream.bit_rate = "mono", _SOUND_BIT_RATE
        self._sound_stream = stream

    def _add_sound(self) -> None:
        """Adds the sound up to the end of the last image. It is called for each image, because the file
        interleaves images and sound.
        """
        if self._sound is None or self._sound_stream is None:
            return
        samples, rate = self._sound
        until = min(round(float(self.count / self._rate) * rate), len(samples))
        if until > self._sound_end:
            part = np.ascontiguousarray(samples[None, self._sound_end : until])
            frame = self._av.AudioFrame.from_ndarray(part, format="s16", layout="mono")
            frame.sample_rate, frame.pts = rate, self._sound_end
            frame.time_base = Fraction(1, rate)
            for packet in self._sound_stream.encode(frame):
                self._file.mux(packet)
            self._sound_end = until

    def add(self, picture: UInt8) -> None:
        """Appends one sRGB image (H, W, 3), or (H, W, 4) with an ignored fourth channel. Any strides are
        allowed.

        Raises:
            ResourceError: if it cannot be written.
        """
        with self._explain_error():
            self._add_picture(picture)

    def _add_picture(self, picture: UInt8) -> None:
        if not self.codec:
            self._choose_encoder((picture.shape[1], picture.shape[0]))
        if not self.count:
            self._begin_video()
        rows = picture[: self.height, : self.width]
        frame = self._av.VideoFrame(self.width, self.height, "rgb24" if rows.shape[2] == 3 else "rgb0")
        plane = frame.planes[0]
        filled = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
        filled[: self.height, : rows.shape[2] * self.width] = rows.reshape(self.height, -1)
        for packet in self._stream.encode(frame):
            self._file.mux(packet)
        self.count += 1
        self._add_sound()

    def close(self) -> None:
        """Writes the remaining images of the encoder and the index, and replaces the target file.

        Raises:
            ResourceError: if it cannot be written.
        """
        with self._explain_error():
            if self.count:
                for stream in filter(None, (self._stream, self._sound_stream)):
                    for packet in stream.encode():
                        self._file.mux(packet)
            self._file.close()
        if self.count:
            self._scope.close()
        else:
            self._remove_unfinished()

    def __enter__(self) -> FilmWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None or not issubclass(kind, Exception):
            self.close()
            return
        with suppress(OSError, ValueError):
            self._file.close()
        self._remove_unfinished()


def _import_pyav() -> Any:
    try:
        import av
    except ImportError:
        raise ResourceError(
            "films need PyAV, which is not installed",
            where="film",
            remedy='Install the extra: pip install "enliven-edge[film]"',
        ) from None
    return av
