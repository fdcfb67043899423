"""Saves the project to its file, and to recovery files while it has unsaved changes."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from enliven.document import Project
from enliven.errors import EnlivenError
from enliven.files import own_folder
from enliven.formats.project import read_project, write_project
from enliven.modeling.possessed import solve_lost
from enliven_viewer.studio.editor import Editor

PROJECT = ".enliven"
_UNNAMED = "Untitled"
_FRESH = 60.0
"""Seconds."""


class ProjectStore:
    """The file of an editor's project.

    A recovery file is written every few seconds while something is not saved, and removed when it is. A
    studio that crashes leaves it behind, and the next one offers it.

    Args:
        folder: where recovery files are; None takes the user's own place.
    """

    def __init__(self, editor: Editor, folder: Path | None = None) -> None:
        self.editor = editor
        self.path: Path | None = None
        self.folder = folder or own_folder()
        self._saved: Project = editor.history.project
        self._autosaved: Project = self._saved
        self._since = time.monotonic()
        self._writer: ThreadPoolExecutor | None = None
        self._writing: tuple[Future[None], Project] | None = None

    @property
    def name(self) -> str:
        """The name of the project: of its file, or "Untitled"."""
        return self.path.stem if self.path else _UNNAMED

    @property
    def named(self) -> bool:
        """Whether the project has a file."""
        return self.path is not None

    @property
    def dirty(self) -> bool:
        """Whether something is not saved."""
        return self.editor.history.project is not self._saved

    @property
    def title(self) -> str:
        """The title of the window: the file, with a star while something is not saved."""
        return f"{'*' * self.dirty}{self.name} - enliven"

    def forget(self) -> None:
        """Give up the unsaved changes."""
        self._saved = self.editor.history.project

    def new(self, project: Project | None = None) -> None:
        """Begin another project; the one before is forgotten."""
        self.path = None
        self._begin(project or Project())

    def open(self, path: Path) -> None:
        """Go on with a project.

        Raises:
            InputError: where the file cannot be read; what is open stays.
        """
        self.take(path, self.read(path))

    @staticmethod
    def read(path: Path) -> Project:
        """Returns the project of a file; may be called in a thread.

        Raises:
            InputError: where the file cannot be read.
        """
        return solve_lost(read_project(path))

    def take(self, path: Path, project: Project) -> None:
        """Go on with a project that was read from a file."""
        self.path = path
        self._begin(project)
        self.editor.toasts.say(f"Opened {path.name}")

    def save(self, path: Path | None = None) -> None:
        """Write the project to its file, or to another that is its file from then on.

        Raises:
            ResourceError: where it cannot be written; the file from before stays.
        """
        target = path or self.path
        assert target is not None, "a project without a file is saved with a path"
        project = self.editor.history.project
        write_project(target, project)
        self.settle()  # before its file goes
        self.path, self._saved, self._autosaved = target, project, project
        self._own().unlink(missing_ok=True)
        self.editor.toasts.say(f"Saved {target.name}")

    def autosave(self, now: float | None = None) -> None:
        """Begin to write the recovery file, beside the window, where it is time and something has changed."""
        now = time.monotonic() if now is None else now
        if self._writing is not None:
            if self._writing[0].done():
                self.settle()
        elif now - self._since >= self.editor.settings.autosave:
            self._since = now
            self._begin_writing()

    def autosave_now(self) -> None:
        """Write the recovery file where something has changed since the last, and wait for it."""
        self.settle()
        self._begin_writing()
        self.settle()

    def _begin_writing(self) -> None:
        project = self.editor.history.project  # a value: it may be edited on while it is written
        if project is self._autosaved or not self.dirty:
            return
        self._writer = self._writer or ThreadPoolExecutor(1, "autosave")
        self._writing = (self._writer.submit(self._write, project), project)

    def _write(self, project: Project) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        write_project(self._own(), project)

    def settle(self) -> None:
        """Wait for the recovery file that is being written, and say where it cannot be."""
        if self._writing is None:
            return
        (written, project), self._writing = self._writing, None
        try:
            written.result()
            self._autosaved = project
        except (OSError, EnlivenError) as error:
            said = error.what if isinstance(error, EnlivenError) else str(error.strerror)
            self.editor.toasts.say(
                f"The recovery file cannot be written ({said})", "Save your work with Ctrl+S."
            )

    def recoverable(self) -> list[Path]:
        """Recovery files of studios that are no longer running, the newest first.

        What a studio had half written when it was killed is removed; the file before it is whole.
        """
        if not self.folder.is_dir():
            return []
        for part in self.folder.glob(f".recovery-*{PROJECT}.part"):
            if not _running(Path(part.stem.removeprefix("."))):
                part.unlink(missing_ok=True)
        found = [path for path in self.folder.glob(f"recovery-*{PROJECT}") if not _running(path)]
        return sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)

    def recover(self, path: Path) -> None:
        """Go on with a recovery file's project, not saved yet.

        Raises:
            InputError: where the file cannot be read; what is open stays.
        """
        project = solve_lost(read_project(path))
        self.new()
        self.editor.edit("recover", lambda _: project)
        self.editor.frame_all()
        self.editor.toasts.say("Recovered", "Save it with Ctrl+S.")
        # It is now this studio's to keep.
        self.folder.mkdir(parents=True, exist_ok=True)
        path.replace(self._own())

    def discard(self, paths: list[Path]) -> None:
        """Remove recovery files."""
        for path in paths:
            with contextlib.suppress(OSError):
                path.unlink()

    def close(self) -> None:
        """Remove the recovery file, since the studio ends without fault."""
        self.settle()
        self._own().unlink(missing_ok=True)

    def _begin(self, project: Project) -> None:
        self.settle()
        self.editor.begin(project)
        self._saved = self._autosaved = self.editor.history.project
        self._own().unlink(missing_ok=True)

    def _own(self) -> Path:
        return self.folder / f"recovery-{os.getpid()}{PROJECT}"


def _running(path: Path) -> bool:
    """Whether the studio that wrote a recovery file still runs."""
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
