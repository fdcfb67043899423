"""Makes a souvenir of each visitor's session: a photo of the widest gesture, or a short film, and its QR
code.

The pictures show the screen without captions. Files are written in the background, so the show never waits
for a disk or an encoder.
"""

from __future__ import annotations

import functools
import io
import logging
import queue
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

from enliven.arrays import UInt8
from enliven.errors import EnlivenError
from enliven.files import write_file
from enliven.film.writer import FilmWriter
from enliven.kiosk.profile import KioskProfile
from enliven.kiosk.souvenir_address import find_souvenir_address
from enliven.kiosk.story import SpotView
from enliven.kiosk.story_table import Phase
from enliven.person import Body
from enliven_viewer.kiosk.show import GLOW_S, ShowFrame
from enliven_viewer.kiosk.souvenir_code import SouvenirCode
from enliven_viewer.render.overlay.canvas import Pen
from enliven_viewer.souvenirs.store import SouvenirStore

log = logging.getLogger(__name__)

Grab = Callable[[int], UInt8]
"""A function that returns (H, W, 3) sRGB of the current picture without captions, top row first. Its argument
is the maximum length of the longer side in pixels.
"""
FIRST_PICTURE_S = GLOW_S + 0.5
"""Seconds from the start of a session to its first picture. During this time the character blends to the
visitor's pose, and its controlled parts glow.
"""
PHOTO_SIZE = 1920
"""Maximum length of a photo's longer side in pixels."""
FILM_SIZE = 960
"""Maximum length of a film's longer side in pixels: enough for a phone, and cheap to encode."""
FILM_RATE = 15.0
"""Pictures of a film per second."""
MIN_FILM_S = 1.0
"""Shortest film in seconds. A shorter one is deleted."""
_PHOTO_INTERVAL_S = 1.0
"""Minimum seconds between two photos. Each photo must read the picture from the GPU."""
_MIN_WIDENING_FACTOR = 1.05
"""A new photo replaces the current one if its gesture is wider by at least this factor."""
_PHOTO_QUALITY = 90
"""Quality of the JPEG file, from 0 to 100."""
_FILM_BIT_RATE = 4.0
"""Bit rate of a film in Mbit/s, for encoders without a quality option."""
_MAX_QUEUED_PICTURES = 30
"""Maximum number of pictures that wait for the encoder, about 50 MB. Further pictures are skipped."""
_MAX_WAIT_S = 30.0
"""A film ends after this number of seconds without a new picture, so that it does not keep the program alive.
"""


@dataclass
class _Session:
    """One visitor's session, which is photographed or filmed.

    Attributes:
        since_s: time at which it began.
        token: the secret in the souvenir's address. Empty before the first picture.
        path: the souvenir's file.
        photo: (H, W, 3) sRGB, the best picture of the session.
        extent: width of the gesture in that picture in metres.
        tried_s: time at which the last photo was tried.
        pictures: the pictures of the film for its encoder, each with its number of repetitions. None ends it.
        is_written: the result of the film's encoder.
        count: number of pictures of the film.
    """

    since_s: float
    token: str = ""
    path: Path = field(default_factory=Path)
    photo: UInt8 | None = None
    extent: float = 0.0
    tried_s: float = 0.0
    pictures: queue.Queue[tuple[UInt8, int] | None] | None = None
    is_written: Future[bool] | None = None
    count: int = 0


class SouvenirMaker:
    """Makes the souvenirs of a kiosk's sessions.

    Args:
        profile: the kiosk. Its ``souvenir.kind`` must not be empty.
        store: creates and deletes the souvenirs' files.

    Attributes:
        codes: the QR codes that are shown, at the right and the left of the picture.
        problem: one sentence for operators; empty if all is well.
    """

    def __init__(self, profile: KioskProfile, store: SouvenirStore) -> None:
        self._settings, self._store = profile.souvenir, store
        self._sessions: dict[int, _Session] = {}
        self._finished: list[tuple[str, Future[bool]]] = []
        self._background = ThreadPoolExecutor(2 * profile.story.performers, "kiosk souvenirs")
        self._shown_s = [0.0, 0.0]
        self.codes: list[SouvenirCode | None] = [None, None]
        self.problem = ""

    def advance(self, frame: ShowFrame, grab: Grab) -> None:
        """Takes pictures of the current sessions, and stores the souvenirs of finished ones."""
        grab = functools.cache(grab)
        for k, spot in enumerate(frame.story.spots):
            if spot.phase is Phase.POSSESSED:
                session = self._sessions.setdefault(k, _Session(spot.since_s))
                self._take_picture_if_due(session, spot, frame, grab)
            elif k in self._sessions:
                self._end_session(self._sessions.pop(k), is_wanted=spot.phase is Phase.FAREWELL)
        self._show_finished_codes(frame.now)

    def draw(self, pen: Pen, size: tuple[int, int]) -> None:
        """Draws the QR codes of the souvenirs into an area of ``size`` pixels (width, height)."""
        for side, code in enumerate(self.codes):
            if code is not None:
                code.draw(pen, size, at_left=side == 1)

    def close(self) -> None:
        """Stops the background work. Unfinished souvenirs are dropped."""
        for session in self._sessions.values():
            self._end_session(session, is_wanted=False)
        self._sessions.clear()
        self._background.shutdown(cancel_futures=True)

    def _take_picture_if_due(self, session: _Session, spot: SpotView, frame: ShowFrame, grab: Grab) -> None:
        """Takes a picture if it is due."""
        elapsed = frame.now - session.since_s - FIRST_PICTURE_S
        if elapsed < 0.0:
            return
        if self._settings.kind == "photo":
            self._take_photo(session, measure_gesture(frame.report.bodies.get(spot.body)), frame.now, grab)
        elif elapsed <= self._settings.length:
            self._film_if_due(session, elapsed, grab)
        elif session.pictures is not None:
            self._end_film(session)

    def _take_photo(self, session: _Session, extent: float, now: float, grab: Grab) -> None:
        """Replaces the photo if the visitor's gesture is wider."""
        is_first = session.photo is None
        if not is_first and (
            extent < _MIN_WIDENING_FACTOR * session.extent or now - session.tried_s < _PHOTO_INTERVAL_S
        ):
            return
        session.photo, session.extent, session.tried_s = grab(PHOTO_SIZE), extent, now

    def _film_if_due(self, session: _Session, elapsed: float, grab: Grab) -> None:
        """Passes a picture to the encoder if one is due. It is repeated if the screen's frame rate is lower
        than the film's.
        """
        due = int(elapsed * FILM_RATE) + 1 - session.count
        if due < 1:
            return
        if session.is_written is None:
            if not self._reserve_file(session):
                return
            session.pictures = queue.Queue()
            session.is_written = self._background.submit(_write_film, session.path, session.pictures)
        if session.pictures is None or session.pictures.qsize() >= _MAX_QUEUED_PICTURES:
            return  # The next picture will be repeated instead.
        session.pictures.put_nowait((grab(FILM_SIZE), due))
        session.count += due

    def _end_session(self, session: _Session, is_wanted: bool) -> None:
        """Ends a session, and stores its souvenir."""
        if session.photo is not None and is_wanted and self._reserve_file(session):
            written = self._background.submit(_write_photo, session.path, session.photo)
            self._finished.append((session.token, written))
        elif session.is_written is not None:
            self._end_film(session)
            if is_wanted:
                self._finished.append((session.token, session.is_written))
            else:
                path = session.path
                session.is_written.add_done_callback(lambda _: path.unlink(missing_ok=True))

    def _end_film(self, session: _Session) -> None:
        """Signals the end of a film to its encoder."""
        if session.pictures is not None:
            session.pictures.put_nowait(None)
            session.pictures = None

    def _reserve_file(self, session: _Session) -> bool:
        """Reserves a file for a session. Returns False if that fails."""
        if session.token:
            return True
        try:
            session.token, session.path = self._store.reserve(self._settings.kind)
        except EnlivenError as error:
            self._report(str(error))
            return False
        return True

    def _show_finished_codes(self, now: float) -> None:
        """Shows the codes of finished souvenirs, each for a limited time."""
        for side, since_s in enumerate(self._shown_s):
            if now - since_s > self._settings.code:
                self.codes[side] = None
        for token, written in [code for code in self._finished if code[1].done()]:
            self._finished.remove((token, written))
            try:
                is_usable = written.result()
            except (EnlivenError, OSError) as error:
                self._report(str(error))
                continue
            if is_usable:
                self._show_code(token, now)

    def _show_code(self, token: str, now: float) -> None:
        """Shows the code of a souvenir."""
        start = find_souvenir_address(self._settings)
        if not start:
            self._report("this computer has no network address, so phones cannot download souvenirs")
            return
        self.problem = ""
        self._background.submit(self._store.delete_expired)
        # Show the code at the right if that is free, otherwise at the left. Otherwise replace the older code.
        side = next((k for k, code in enumerate(self.codes) if code is None), None)
        if side is None:
            side = min(range(len(self.codes)), key=self._shown_s.__getitem__)
        self.codes[side], self._shown_s[side] = SouvenirCode(start + token, self._settings), now

    def _report(self, problem: str) -> None:
        """Reports a problem to operators, once."""
        if problem != self.problem:
            log.warning("%s", problem)
        self.problem = problem


def measure_gesture(body: Body | None) -> float:
    """Returns the width plus the height of a body's bounding box in metres, or 0 if the body is None."""
    if body is None or not np.isfinite(body.joints).all():
        return 0.0
    return float(np.ptp(body.joints[:, :2], axis=0).sum())


def _write_photo(path: Path, pixels: UInt8) -> bool:
    """Writes a photo, (H, W, 3) sRGB, as JPEG. Returns True."""
    encoded = io.BytesIO()
    Image.fromarray(pixels).save(encoded, "JPEG", quality=_PHOTO_QUALITY)
    write_file(path, encoded.getvalue(), durable=False)
    return True


def _write_film(path: Path, pictures: queue.Queue[tuple[UInt8, int] | None]) -> bool:
    """Writes the queued pictures as a film until None arrives. Deletes a film that is too short, and returns
    False.
    """
    with FilmWriter(path, None, FILM_RATE, _FILM_BIT_RATE) as film:
        try:
            while (item := pictures.get(timeout=_MAX_WAIT_S)) is not None:
                pixels, repetitions = item
                for _ in range(repetitions):
                    film.add(pixels)
        except queue.Empty:
            log.warning("a souvenir film lacks its last pictures, because rendering stopped")
        is_usable = film.count >= MIN_FILM_S * FILM_RATE
    if not is_usable:
        path.unlink(missing_ok=True)
    return is_usable
