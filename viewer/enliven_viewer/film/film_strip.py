"""Encodes the images of a film, and selects the images of its contact sheet, in a background thread."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType

from enliven.arrays import UInt8
from enliven.film.writer import FilmWriter
from enliven_viewer.film.sheet import Tiles

MAX_QUEUED_IMAGES = 4
"""Maximum number of images that wait for the encoder. An image of 1280 x 720 pixels takes 3.7 MB."""


class FilmStrip:
    """A queue of images. A background thread passes them in order to the film and the sheet.

    The end of the ``with`` block waits until the last image is written.

    An encoder error is raised by a later :meth:`add`, or at the end of ``with``.

    Args:
        writer: writer of the film file; None for a sheet without a film.
        tiles: collects the images of the contact sheet.
    """

    def __init__(self, writer: FilmWriter | None, tiles: Tiles) -> None:
        self._writer, self._tiles = writer, tiles
        self._thread = ThreadPoolExecutor(1, "film")
        self._waiting: deque[Future[None]] = deque()

    def add(self, second: float, raw: UInt8) -> None:
        """Appends an image, (H, W, 4) with the bottom row first, ``second`` seconds into the film."""
        while len(self._waiting) >= MAX_QUEUED_IMAGES:
            self._waiting.popleft().result()
        self._waiting.append(self._thread.submit(self._finish, second, raw))

    def _finish(self, second: float, raw: UInt8) -> None:
        picture = raw[::-1]
        self._tiles.add(second, picture)
        if self._writer:
            self._writer.add(picture)

    def __enter__(self) -> FilmStrip:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._thread.shutdown(wait=True)
        if error is None:
            for work in self._waiting:
                work.result()
