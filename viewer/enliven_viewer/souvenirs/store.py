"""Stores the files of souvenirs. Manages their secret names, their expiry, and a limit on their
total size.
"""

from __future__ import annotations

import contextlib
import itertools
import re
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from enliven.errors import ResourceError
from enliven.files import PART_SUFFIX, user_data_folder
from enliven.kiosk.profile import MAX_SOUVENIR_AGE_S, KioskProfile
from enliven.web_server.access import is_token, make_token, tokens_match

SUFFIXES = {"photo": ".jpg", "film": ".mp4"}
"""File extension of each kind of souvenir."""
MAX_FILES = 2000
"""Maximum number of souvenirs, so that listing them stays fast."""
MAX_PART_AGE_S = 600.0
"""An unfinished file older than this number of seconds is deleted, because its program must have been killed.
A film takes less time.
"""
_NAME = re.compile(r"(?P<token>[A-Za-z0-9_-]{22})-(?P<end>[0-9]{1,12})(?P<suffix>\.jpg|\.mp4)")
"""Pattern of a file name: token, Unix time of the deletion in seconds, and extension."""


@dataclass(frozen=True)
class Souvenir:
    """One photo or film.

    Attributes:
        path: its file.
        token: the secret part of its web address.
        end_s: Unix time of its deletion in seconds.
        size: size of the file in bytes.
    """

    path: Path
    token: str
    end_s: float
    size: int


class SouvenirStore:
    """The folder with the souvenirs of this user's kiosks.

    Each file's name contains the time of its deletion. So every program of a kiosk can delete it, even after
    the profile has changed.

    Args:
        folder: the folder. It is created for this user only.
        keep_s: seconds until a souvenir is deleted.
        max_bytes: maximum total size of the files.
        min_free_bytes: minimum free space on the disk for a new souvenir.
        clock: returns the Unix time in seconds.
    """

    def __init__(
        self,
        folder: Path,
        keep_s: float,
        max_bytes: int,
        min_free_bytes: int = 0,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._folder, self._keep_s, self._max_bytes = folder, keep_s, max_bytes
        self._min_free_bytes, self._clock = min_free_bytes, clock

    def reserve(self, kind: str) -> tuple[str, Path]:
        """Returns the token and the path of a new souvenir, which the caller writes.

        Args:
            kind: one of :data:`SUFFIXES`.

        Raises:
            ResourceError: if the folder cannot be created, or the disk is too full.
        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            free = shutil.disk_usage(self._folder).free
        except OSError as error:
            raise ResourceError(
                f"souvenirs cannot be stored ({error.strerror})", where=str(self._folder)
            ) from None
        if free < self._min_free_bytes:
            raise ResourceError(
                f"the disk has too little free space for souvenirs ({free / 1e9:.1f} GB)",
                where=str(self._folder),
                remedy="Delete files, or lower care.keep_free in the profile.",
            )
        token = make_token()
        return token, self._folder / f"{token}-{round(self._clock() + self._keep_s)}{SUFFIXES[kind]}"

    def find(self, token: str) -> Path | None:
        """Returns the file of a souvenir, or None if the token is unknown or the souvenir has expired."""
        if not is_token(token):
            return None
        souvenir = next(
            (souvenir_entry for souvenir_entry in self._list() if tokens_match(token, souvenir_entry.token)),
            None,
        )
        return None if souvenir is None or self._is_over(souvenir) else souvenir.path

    def delete_expired(self) -> int:
        """Deletes expired souvenirs, the oldest souvenirs beyond the limits, and unfinished files of killed
        programs.

        Returns:
            The number of souvenirs that are left.
        """
        self._remove_parts()
        kept_souvenirs = []
        for souvenir in self._list():
            if self._is_over(souvenir):
                _remove(souvenir.path)
            else:
                kept_souvenirs.append(souvenir)
        kept_souvenirs.sort(key=lambda souvenir: souvenir.end_s, reverse=True)
        sizes = itertools.accumulate(souvenir.size for souvenir in kept_souvenirs)
        fits = [size <= self._max_bytes and k < MAX_FILES for k, size in enumerate(sizes)]
        for souvenir, has_room in zip(kept_souvenirs, fits, strict=True):
            if not has_room:
                _remove(souvenir.path)
        return sum(fits)

    def _is_over(self, souvenir: Souvenir) -> bool:
        """Returns True if a souvenir has expired. Setting the clock back does not prolong its life."""
        left_s = souvenir.end_s - self._clock()
        return left_s <= 0.0 or left_s > MAX_SOUVENIR_AGE_S + 1.0

    def _list(self) -> Iterator[Souvenir]:
        """Yields the souvenirs in the folder. Ignores other files and links."""
        with contextlib.suppress(OSError):
            for path in self._folder.iterdir():
                match = _NAME.fullmatch(path.name)
                if match is None:
                    continue
                with contextlib.suppress(OSError):
                    if path.is_file() and not path.is_symlink():
                        yield Souvenir(path, match["token"], float(match["end"]), path.stat().st_size)

    def _remove_parts(self) -> None:
        """Deletes unfinished files that a killed program left."""
        with contextlib.suppress(OSError):
            for path in self._folder.glob(f".*{PART_SUFFIX}"):
                with contextlib.suppress(OSError):
                    if abs(self._clock() - path.lstat().st_mtime) > MAX_PART_AGE_S:
                        path.unlink()


def make_store(profile: KioskProfile) -> SouvenirStore:
    """Returns the store of a kiosk's souvenirs, in the user's data folder."""
    settings = profile.souvenir
    return SouvenirStore(
        user_data_folder() / "souvenirs",
        60.0 * settings.keep,
        round(settings.space * 1e6),
        round(profile.care.keep_free * 1e9),
    )


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()
