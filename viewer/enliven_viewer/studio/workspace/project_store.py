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
from enliven.files import PART, own_folder, read_file, write_file
from enliven.formats.project import (
    project_bytes,
    project_of,
    read_project,
    refuse_later_project,
    write_project,
)
from enliven.modeling.possessed import solve_lost
from enliven_viewer.language import tr
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.perform import StageRecording

PROJECT = ".enliven"
_UNNAMED = "Untitled"
_FRESH = 60.0
"""Seconds."""
_WRITING_SHARE = 0.1
"""Highest share of the time that is spent on recovery files: a long recording takes seconds to write."""
log = logging.getLogger(__name__)


class FileChangedError(InputError):
    """The file of the project has been saved by another window or program since it was opened here."""


class ProjectStore:
    """The file of an editor's project.

    A recovery file is written every few seconds while something is not saved, and removed when it is. A
    studio that crashes leaves it behind, and the next one offers it.

    Args:
        folder: where recovery files are; None takes the user's own place.

    Attributes:
        recording: the recording from the stage, which is work as well while it runs.
    """

    def __init__(self, editor: Editor, folder: Path | None = None) -> None:
        self.editor = editor
        self.recording: StageRecording | None = None
        self.path: Path | None = None
        self.folder = folder or own_folder()
        self._saved: Project = editor.history.project
        self._autosaved: Project = self._saved
        self._since = time.monotonic()
        self._pause = 0.0
        self._content = ""  # the checksum of the file as this window read or wrote it last
        self._writer: ThreadPoolExecutor | None = None
        self._writing: tuple[Future[None], Project] | None = None

    @property
    def name(self) -> str:
        """Returns the name of the project: of its file, or "Untitled"."""
        return self.path.stem if self.path else _UNNAMED

    @property
    def named(self) -> bool:
        """Returns True if the project has a file."""
        return self.path is not None

    @property
    def dirty(self) -> bool:
        """Returns True if something is not saved: edits, or a recording that runs."""
        return self.editor.history.project is not self._saved or self.records

    @property
    def records(self) -> bool:
        """Returns True if a recording runs."""
        return self.recording is not None and self.recording.phase == "recording"

    @property
    def title(self) -> str:
        """Returns the title of the window: the file, with a star while something is not saved."""
        return f"{'*' * self.dirty}{self.name} - enliven"

    def forget(self) -> None:
        """Gives up the unsaved changes, and a recording that runs."""
        if self.recording is not None:
            self.recording.drop()
        self._saved = self.editor.history.project

    def new(self, project: Project | None = None) -> None:
        """Begins another project; the one before is forgotten."""
        self.path, self._content = None, ""
        self._begin(project or Project())

    def open(self, path: Path) -> None:
        """Goes on with a project.

        Raises:
            InputError: if the file cannot be read; what is open stays.
        """
        self.take(path, self.read(path))

    @staticmethod
    def read(path: Path) -> tuple[Project, str]:
        """Returns the project of a file and the checksum of its content; may be called in a thread.

        Raises:
            InputError: if the file cannot be read.
        """
        data = read_file(path)
        return solve_lost(project_of(data, str(path))), _checksum(data)

    def take(self, path: Path, read: tuple[Project, str]) -> None:
        """Goes on with what :meth:`read` returned for a file."""
        project, content = read
        self.path, self._content = path, content
        self._begin(project)
        self.editor.toasts.say(tr("Opened {0}", path.name))

    def save(self, path: Path | None = None, *, over: bool = False) -> None:
        """Writes the project to its file, or to another that is its file from then on.

        What a running recording has so far is written as well; the recording goes on.

        Args:
            over: also where another window or program has saved the file since.

        Raises:
            FileChangedError: if another window or program has; nothing is written.
            LaterVersionError: if the file is a project of a later version; nothing is written.
            ResourceError: if it cannot be written; the file from before stays.
        """
        target = path or self.path
        assert target is not None, "a project without a file is saved with a path"
        project = self.editor.history.project
        change = self._so_far()
        written = project if change is None else _with(project, change)
        data = project_bytes(written)
        refuse_later_project(target)
        if not over:
            self._refuse_changed(target, data)
        write_file(target, data, tr("Save it elsewhere."))
        self.settle()  # before its file goes
        # The file holds part of a recording, so the window counts as unsaved until the next save.
        self._saved = self._autosaved = written
        self.path, self._content = target, _checksum(data)
        self._own().unlink(missing_ok=True)
        self.editor.toasts.say(tr("Saved {0}", target.name))

    def saved_now(self) -> Project:
        """Returns the project that the file holds now, which another window may have saved.

        Raises:
            InputError: if the file cannot be read.
        """
        assert self.path is not None, "only a project with a file has one that is saved"
        return solve_lost(read_project(self.path))

    def _so_far(self) -> Callable[[Project], Project] | None:
        """Returns the edit that stores the recording so far; None without a recording."""
        return None if self.recording is None else self.recording.so_far()

    def _refuse_changed(self, target: Path, data: bytes) -> None:
        """Raises FileChangedError if the file differs from the last save here and from the new content."""
        if self.path is None or not _is_same_file(target, self.path):
            return  # the dialogue asked before another file is replaced
        try:
            now = _checksum(read_file(target))
        except InputError:
            return  # it is gone, or writing says what is wrong with it
        if now not in (self._content, _checksum(data)):
            raise FileChangedError(
                tr("{0} was saved by another window or program since it was opened here", target.name),
                where=str(target),
                mend=tr("Save under another name, or compare the two."),
            )

    def autosave(self, now: float | None = None) -> None:
        """Begins to write the recovery file, in the background, where it is time and something has
        changed.
        """
        now = time.monotonic() if now is None else now
        if self._writing is not None:
            if self._writing[0].done():
                self.settle()
        elif now - self._since >= max(self.editor.settings.autosave, self._pause):
            self._since = now
            self._begin_writing()

    def autosave_now(self) -> None:
        """Writes the recovery file where something has changed since the last, and waits for it."""
        self.settle()
        self._begin_writing()
        self.settle()

    def _begin_writing(self) -> None:
        project, change = self.editor.history.project, self._so_far()
        if change is None and (project is self._autosaved or not self.dirty):
            return
        self._writer = self._writer or ThreadPoolExecutor(1, "autosave")
        # A project is immutable and the change has its own copy, so the window can go on.
        self._writing = (self._writer.submit(self._write, project, change), project)

    def _write(self, project: Project, change: Callable[[Project], Project] | None) -> None:
        began = time.monotonic()
        self.folder.mkdir(parents=True, exist_ok=True)
        write_project(self._own(), project if change is None else _with(project, change))
        self._pause = (time.monotonic() - began) / _WRITING_SHARE

    def settle(self) -> None:
        """Waits for the recovery file that is being written, and says where it cannot be."""
        if self._writing is None:
            return
        (written, project), self._writing = self._writing, None
        try:
            written.result()
            self._autosaved = project
        except (OSError, EnlivenError) as error:
            said = error.what if isinstance(error, EnlivenError) else str(error.strerror)
            self.editor.toasts.say(
                tr("The recovery file cannot be written ({0})", said), tr("Save your work with Ctrl+S.")
            )

    def recoverable(self) -> list[Path]:
        """Recovery files of studios that are no longer running, the newest first.

        What a studio had half written when it was killed is removed; the file before it is whole.
        """
        if not self.folder.is_dir():
            return []
        for part in self.folder.glob(f".recovery-*{PROJECT}*{PART}"):
            if not _running(Path(part.name.removeprefix(".").partition(PROJECT)[0] + PROJECT)):
                part.unlink(missing_ok=True)
        found = [path for path in self.folder.glob(f"recovery-*{PROJECT}") if not _running(path)]
        return sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)

    def recover(self, path: Path) -> None:
        """Goes on with a recovery file's project, not saved yet.

        Raises:
            InputError: if the file cannot be read; what is open stays.
        """
        project = solve_lost(read_project(path))
        self.new()
        self.editor.edit("recover", lambda _: project)
        self.editor.frame_all()
        self.editor.toasts.say(tr("Recovered"), tr("Save it with Ctrl+S."))
        # It is now this studio's to keep.
        self.folder.mkdir(parents=True, exist_ok=True)
        path.replace(self._own())

    def discard(self, paths: list[Path]) -> None:
        """Removes recovery files."""
        for path in paths:
            with contextlib.suppress(OSError):
                path.unlink()

    def close(self) -> None:
        """Removes the recovery file, since the studio ends without fault."""
        self.settle()
        self._own().unlink(missing_ok=True)

    def _begin(self, project: Project) -> None:
        self.settle()
        self.editor.begin(project)
        self._saved = self._autosaved = self.editor.history.project
        self._own().unlink(missing_ok=True)

    def _own(self) -> Path:
        return self.folder / f"recovery-{os.getpid()}{PROJECT}"


def _with(project: Project, change: Callable[[Project], Project]) -> Project:
    """Returns a project with the recording so far, or without it if it cannot be stored yet."""
    try:
        return change(project)
    except EnlivenError:  # nothing has moved yet
        return replace(project)
    except Exception as error:  # the rest of the work must not be lost by it
        log.error("what is being recorded cannot be saved yet", exc_info=error)
        return replace(project)


def _checksum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _is_same_file(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:
        return one == other


def _running(path: Path) -> bool:
    """Returns True if the studio that wrote a recovery file still runs."""
    number = path.stem.removeprefix("recovery-")
    if not number.isdigit():
        return False
    if int(number) == os.getpid():
        return True
    if sys.platform == "win32":  # where asking for a process by a signal ends it
        return time.time() - path.stat().st_mtime < _FRESH
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
