"""Reports of the kiosk's window to operators: its state, a picture of the screen, and proof that the picture
changes.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable
from pathlib import Path

from PIL import Image

from enliven.arrays import UInt8
from enliven.errors import EnlivenError
from enliven.files import write_picture
from enliven.supervision.notify import Notifier
from enliven.supervision.records import SCREEN_PICTURE_FILE, ServiceRecord, runtime_folder, write_service

log = logging.getLogger(__name__)

SERVICE = "window"
"""Name of the window in the supervisor's list of services."""
_RECORD_INTERVAL_S = 2.0
"""Seconds between two records of the state."""
_PICTURE_INTERVAL_S = 10.0
"""Seconds between two pictures of the screen."""
_PROBE_INTERVAL_S = 0.5
"""Seconds between two checks that the picture has changed."""
_PICTURE_WIDTH = 480
"""Width in pixels of the picture for operators. It is too small to identify people."""
_PROBLEM_DELAY_S = 5.0
"""Seconds for which a problem must last before it is logged. Short interruptions are normal."""


class OperatorReport:
    """Reports about one window.

    Args:
        notifier: notifies the supervisor; None for the one that the environment names.
        folder: the runtime folder; None for the default.
    """

    def __init__(self, notifier: Notifier | None = None, folder: Path | None = None) -> None:
        self._notifier, self._folder = notifier or Notifier(), folder
        self._started_s = time.time()
        self._progress_s = 0.0
        self._probed = self._recorded = self._pictured = -_PICTURE_INTERVAL_S
        self._probe = b""
        self._count, self._fps = 0, 0.0
        self._problem, self._problem_since = "", 0.0
        self._logged = ""

    def report_picture(self, now: float, status: str, problem: str, probe: Callable[[], bytes]) -> None:
        """Reports that a new picture is on the screen.

        Reports progress only if the picture differs from the previous one, so that a frozen picture is
        noticed.

        Args:
            now: monotonic time in seconds.
            status: the state of the story.
            problem: one sentence for operators; empty if all is well.
            probe: returns the pixels of a small copy of the picture, for comparison.
        """
        self._count += 1
        self._log_problem(now, problem)
        text = problem or status
        if now - self._probed >= _PROBE_INTERVAL_S:
            self._probed = now
            pixels = probe()
            if pixels != self._probe:
                self._probe, self._progress_s = pixels, time.time()
                self._notifier.report_progress(text)
        if now - self._recorded >= _RECORD_INTERVAL_S:
            self._fps = self._count / (now - self._recorded)
            self._recorded, self._count = now, 0
            self._write_record(text)

    def write_picture_if_due(self, now: float, pixels: Callable[[], UInt8]) -> None:
        """Writes a small picture of the screen if one is due. Continues if the disk is full.

        Args:
            pixels: returns (H, W, 3) sRGB, top row first.
        """
        if now - self._pictured < _PICTURE_INTERVAL_S:
            return
        self._pictured = now
        image = Image.fromarray(pixels())
        image.thumbnail((_PICTURE_WIDTH, _PICTURE_WIDTH))
        try:
            write_picture((self._folder or runtime_folder()) / SCREEN_PICTURE_FILE, image)
        except (EnlivenError, OSError) as error:
            log.warning("%s", error)

    def report_ready(self) -> None:
        """Reports that the first picture is on the screen."""
        self._notifier.report_ready("the window is open")

    def close(self) -> None:
        """Reports that the window closes as intended."""
        self._notifier.report_stopping()
        self._notifier.close()

    def _write_record(self, text: str) -> None:
        figures = {"fps": round(self._fps, 1)}
        record = ServiceRecord(SERVICE, os.getpid(), self._started_s, self._progress_s, text, figures)
        try:
            write_service(record, self._folder)
        except (EnlivenError, OSError) as error:
            log.warning("%s", error)

    def _log_problem(self, now: float, problem: str) -> None:
        """Logs the start of a lasting problem once, and its end once."""
        if problem != self._problem:
            self._problem, self._problem_since = problem, now
        if self._problem != self._logged and now - self._problem_since >= _PROBLEM_DELAY_S:
            log.warning("%s", problem) if problem else log.info(
                "the problem has been resolved: %s", self._logged
            )
            self._logged = problem
