"""Saves the project to its file, and to recovery files while it has unsaved changes."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from enliven.document import Project
from enliven.errors import EnlivenError, InputError
from enliven.files import PART_SUFFIX, read_file, user_data_folder, write_file
from enliven.formats.project.file import (
    parse_project,
    project_bytes,
    read_project,
    refuse_later_project,
    write_project,
)
from enliven.modeling.possessed.solving import solve_lost
from enliven_viewer.language import tr
from enliven_viewer.studio.app.contributions import TimelineRecording
from enliven_viewer.studio.editor.editor import Editor

PROJECT_SUFFIX = ".enliven"
_DEFAULT_NAME = "Untitled"
_RECOVERY_OWNER_AGE_S = 60.0
"""On Windows, a recovery file younger than this number of seconds is assumed to belong to a
running studio.
"""
_MAX_WRITING_FRACTION = 0.1
"""Maximum fraction of the time that is spent on writing recovery files. Writing a project with a long
recording takes seconds.
"""
log = logging.getLogger(__name__)


class FileChangedError(InputError):
    """Raised if another window or program has saved the project's file since this window opened it."""


class ProjectStore:
    """The file of an editor's project, and its recovery file.

    While there are unsaved changes, a recovery file is written every few seconds. Saving removes it. If the
    studio crashes, the file remains, and the studio offers it at the next start.

    Args:
        folder: folder of the recovery files. None means the user's own data folder.

    Attributes:
        recording: the recording onto the timeline, which counts as unsaved work while it runs.
        saved_at: monotonic time of the last save or recovery file, in seconds.
    """

    def __init__(self, editor: Editor, folder: Path | None = None) -> None:
        self.editor = editor
        self.recording = TimelineRecording()
        self.path: Path | None = None
        self.folder = folder or user_data_folder()
        self._saved: Project = editor.history.project
        self._autosaved: Project = self._saved
        self.saved_at = time.monotonic()
        self._pause = 0.0
        # Checksum of the file's content when this window last read or wrote it.
        self._content = ""
        self._writer: ThreadPoolExecutor | None = None
        self._writing: tuple[Future[None], Project] | None = None

    @property
    def name(self) -> str:
        """Returns the project's name: the name of its file, or "Untitled"."""
        return self.path.stem if self.path else _DEFAULT_NAME

    @property
    def named(self) -> bool:
        """Returns True if the project has a file."""
        return self.path is not None

    @property
    def dirty(self) -> bool:
        """Returns True if there is unsaved work: edits or a running recording."""
        return self.editor.history.project is not self._saved or self.records

    @property
    def records(self) -> bool:
        """Returns True if a recording is running."""
        return self.recording.phase == "recording"

    @property
    def title(self) -> str:
        """Returns the window title: the project's name, with a star while there is unsaved work."""
        return f"{'*' * self.dirty}{self.name} - enliven"

    def forget(self) -> None:
        """Discards the unsaved changes, and a running recording."""
        self.recording.discard()
        self._saved = self.editor.history.project

    def new(self, project: Project | None = None) -> None:
        """Starts another project and drops the current one."""
        self.path, self._content = None, ""
        self._begin(project or Project())

    def open(self, path: Path) -> None:
        """Opens a project file.

        Raises:
            InputError: if the file cannot be read; the open project stays.
        """
        self.take(path, self.read(path))

    @staticmethod
    def read(path: Path) -> tuple[Project, str]:
        """Reads a project file.

        Returns the project and the checksum of the content. May be called in a thread.

        Raises:
            InputError: if the file cannot be read.
        """
        data = read_file(path)
        return solve_lost(parse_project(data, str(path))), _compute_checksum(data)

    def take(self, path: Path, read: tuple[Project, str]) -> None:
        """Opens the project that :meth:`read` returned for a file."""
        project, content = read
        self.path, self._content = path, content
        self._begin(project)
        self.editor.toasts.show_message(tr("Opened {0}", path.name))

    def save(self, path: Path | None = None, *, over: bool = False) -> None:
        """Writes the project to its file. If another path is given, that becomes the project's file.

        Also saves the existing part of a running recording, which continues.

        Args:
            over: if True, overwrite the file even if another window or program has changed it.

        Raises:
            FileChangedError: if another window or program has changed the file. Nothing is written.
            LaterVersionError: if a later version of enliven has written the file. Nothing is written.
            ResourceError: if the file cannot be written. The previous file stays.
        """
        target = path or self.path
        assert target is not None, "a project without a file needs a path"
        project = self.editor.history.project
        change = self.recording.make_unfinished_edit()
        written = project if change is None else _add_unfinished_recording(project, change)
        data = project_bytes(written)
        refuse_later_project(target)
        if not over:
            self._refuse_changed(target, data)
        write_file(target, data, tr("Save the project in another folder."))
        self.settle()  # Wait for the recovery file to be written before it is removed.
        # The saved file contains only the first part of the recording, so the project stays unsaved until the
        # next save.
        self._saved = self._autosaved = written
        self.path, self._content = target, _compute_checksum(data)
        self._find_recovery_path().unlink(missing_ok=True)
        self.editor.toasts.show_message(tr("Saved {0}", target.name))

    def read_saved(self) -> Project:
        """Returns the project that the file contains now. Another window may have saved it.

        Raises:
            InputError: if the file cannot be read.
        """
        assert self.path is not None, "the project has no file yet"
        return solve_lost(read_project(self.path))

    def _refuse_changed(self, target: Path, data: bytes) -> None:
        """Raises FileChangedError if the file's content is neither that of this window's last save nor the
        new content.
        """
        if self.path is None or not _is_same_file(target, self.path):
            return  # The file dialogue has already asked before replacing another file.
        try:
            now = _compute_checksum(read_file(target))
        except InputError:
            return  # The file is missing, or writing will report the error.
        if now not in (self._content, _compute_checksum(data)):
            raise FileChangedError(
                tr("{0} was saved by another window or program since it was opened here", target.name),
                where=str(target),
                remedy=tr("Save under another name, or compare the two versions."),
            )

    def autosave(self, now: float | None = None) -> None:
        """Starts to write the recovery file in the background if it is due and the project has changed."""
        now = time.monotonic() if now is None else now
        if self._writing is not None:
            if self._writing[0].done():
                self.settle()
        elif now - self.saved_at >= max(self.editor.settings.autosave, self._pause):
            self.saved_at = now
            self._begin_writing()

    def autosave_now(self) -> None:
        """Writes the recovery file now if the project has changed since the last recovery file, and waits for
        it.
        """
        self.settle()
        self._begin_writing()
        self.settle()

    def _begin_writing(self) -> None:
        project, change = self.editor.history.project, self.recording.make_unfinished_edit()
        if change is None and (project is self._autosaved or not self.dirty):
            return
        self._writer = self._writer or ThreadPoolExecutor(1, "autosave")
        # Write in the background. The window can continue, because a project is immutable and the recording
        # is a copy.
        self._writing = (self._writer.submit(self._write, project, change), project)

    def _write(self, project: Project, change: Callable[[Project], Project] | None) -> None:
        start_s = time.monotonic()
        self.folder.mkdir(parents=True, exist_ok=True)
        write_project(
            self._find_recovery_path(),
            project if change is None else _add_unfinished_recording(project, change),
        )
        self._pause = (time.monotonic() - start_s) / _MAX_WRITING_FRACTION

    def settle(self) -> None:
        """Waits until the recovery file is written. Shows a message if that fails."""
        if self._writing is None:
            return
        (written, project), self._writing = self._writing, None
        try:
            written.result()
            self._autosaved = project
        except (OSError, EnlivenError) as error:
            reason = error.what if isinstance(error, EnlivenError) else str(error.strerror)
            self.editor.toasts.show_message(
                tr("The recovery file cannot be written ({0})", reason), tr("Press Ctrl+S to save your work.")
            )

    def list_recoverable(self) -> list[Path]:
        """Returns the recovery files of studios that are no longer running, newest first.

        Removes partly written files of a killed studio. The previous recovery file is complete.
        """
        if not self.folder.is_dir():
            return []
        for part in self.folder.glob(f".recovery-*{PROJECT_SUFFIX}*{PART_SUFFIX}"):
            if not _is_owner_running(
                Path(part.name.removeprefix(".").partition(PROJECT_SUFFIX)[0] + PROJECT_SUFFIX)
            ):
                part.unlink(missing_ok=True)
        recovery_files = [
            path for path in self.folder.glob(f"recovery-*{PROJECT_SUFFIX}") if not _is_owner_running(path)
        ]
        return sorted(recovery_files, key=lambda path: path.stat().st_mtime, reverse=True)

    def recover(self, path: Path) -> None:
        """Opens the project of a recovery file as unsaved work.

        Raises:
            InputError: if the file cannot be read; the open project stays.
        """
        project = solve_lost(read_project(path))
        self.new()
        self.editor.edit("recover", lambda _: project)
        self.editor.frame_all()
        self.editor.toasts.show_message(tr("Recovered"), tr("Press Ctrl+S to save the project."))
        # From now on, this window owns the recovery file.
        self.folder.mkdir(parents=True, exist_ok=True)
        path.replace(self._find_recovery_path())

    def discard(self, paths: list[Path]) -> None:
        """Removes recovery files."""
        for path in paths:
            with contextlib.suppress(OSError):
                path.unlink()

    def close(self) -> None:
        """Removes the recovery file at a regular exit."""
        self.settle()
        self._find_recovery_path().unlink(missing_ok=True)

    def _begin(self, project: Project) -> None:
        self.settle()
        self.editor.open_project(project)
        self._saved = self._autosaved = self.editor.history.project
        self._find_recovery_path().unlink(missing_ok=True)

    def _find_recovery_path(self) -> Path:
        return self.folder / f"recovery-{os.getpid()}{PROJECT_SUFFIX}"


def _add_unfinished_recording(project: Project, change: Callable[[Project], Project]) -> Project:
    """Returns the project with the unfinished recording added, or unchanged if the recording cannot be stored
    yet.
    """
    try:
        return change(project)
    except EnlivenError:  # The recording contains no motion yet.
        return replace(project)
    except Exception as error:  # An error in the recording must not prevent saving the rest of the project.
        log.error("the running recording cannot be saved, so the project is saved without it", exc_info=error)
        return replace(project)


def _compute_checksum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _is_same_file(first: Path, second: Path) -> bool:
    try:
        return first.samefile(second)
    except OSError:
        return first == second


def _is_owner_running(path: Path) -> bool:
    """Returns True if the studio that wrote a recovery file is still running."""
    number = path.stem.removeprefix("recovery-")
    if not number.isdecimal():
        return False
    if int(number) == os.getpid():
        return True
    if sys.platform == "win32":
        # On Windows, os.kill would end the process, so judge by the age of the file instead.
        return time.time() - path.stat().st_mtime < _RECOVERY_OWNER_AGE_S
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
