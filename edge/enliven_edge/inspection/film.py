"""Writes pictures to an MP4 file by PyAV, an extra: a sensor's computer needs no films."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

from enliven.arrays import UInt8
from enliven.errors import ResourceError
from enliven.film_encoders import choose_encoder


class DepthFilm:
    """A film of a recording that grows picture by picture; ``with`` completes it.

    Args:
        path: of the .mp4 file; its folder is made.
        rate: pictures a second.

    Raises:
        ResourceError: where PyAV is missing, has no encoder, or the file cannot be written.
    """

    def __init__(self, path: Path, rate: float) -> None:
        av = _pyav()
        self.path, self._rate = path, Fraction(rate).limit_denominator(1001)
        self._av = av
        self._stream: Any = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = av.open(str(path), "w", format="mp4")
        except OSError as error:
            raise ResourceError(
                f"the film cannot be written ({error.strerror})",
                where=str(path),
                mend="Choose another place.",
            ) from None

    def add(self, picture: UInt8) -> None:
        """Appends one (H, W, 3) sRGB picture; all have the size of the first (an odd row or column is
        cut)."""
        height, width = picture.shape[0] // 2 * 2, picture.shape[1] // 2 * 2
        if self._stream is None:
            self._stream = self._begin(width, height)
        frame = self._av.VideoFrame.from_ndarray(picture[:height, :width].copy(), format="rgb24")
        for packet in self._stream.encode(frame):
            self._file.mux(packet)

    def _begin(self, width: int, height: int) -> Any:
        encoder = choose_encoder(self._av, (width, height))
        stream = self._file.add_stream(encoder.name, rate=self._rate, options=dict(encoder.options))
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        return stream

    def close(self) -> None:
        """Writes the remaining frames and the index."""
        if self._stream is not None:
            for packet in self._stream.encode():
                self._file.mux(packet)
        self._file.close()

    def __enter__(self) -> DepthFilm:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
        if self._stream is None:
            self.path.unlink(missing_ok=True)


def _pyav() -> Any:
    try:
        import av
    except ImportError:
        raise ResourceError(
            "films need PyAV, which is not installed",
            where="film",
            mend='Install the extra: pip install "enliven-edge[film]"',
        ) from None
    return av
