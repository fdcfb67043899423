"""The model of a file browser, independent of the window: a folder, its selectable entries, and a name."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from enliven.errors import InputError, ResourceError
from enliven_viewer.language import later, tr

Order = Literal["name", "newest", "largest"]
"""Sort orders of the files in a folder."""
ORDER_LABELS: dict[Order, str] = {
    "name": later("by name"),
    "newest": later("newest first"),
    "largest": later("largest first"),
}
"""Every sort order, with its label in the dialogue."""
_HOME_FOLDERS = ("Desktop", "Documents", "Downloads", "Pictures", "Videos", "Movies")
"""Folders that desktop environments create in the home folder. The dialogue offers those that exist."""
_MOUNT_FOLDERS = ("/media", "/run/media", "/Volumes", "/mnt")
"""Folders in which operating systems mount USB sticks and memory cards."""
_MAX_PLACES = 14
"""Maximum number of offered folders. More do not fit next to the file list."""


def list_places(recent: list[str], working: Path | None = None) -> list[tuple[str, Path]]:
    """Returns the folders that a dialogue offers as shortcuts, each with its name. Recent folders come last.

    Args:
        recent: paths of the files opened or saved most recently, newest first.
        working: the folder in which the program was started.
    """
    home = Path.home()
    folders = [(tr("Home"), home), *((name, home / name) for name in _HOME_FOLDERS)]
    if working is not None and working != home:
        folders.append((working.name or str(working), working))
    folders += _list_removable_drives()
    folders.append((tr("Computer"), Path(home.anchor)))
    for name in recent:
        folder = Path(name).parent
        folders.append((folder.name or str(folder), folder))
    names_by_folder: dict[Path, str] = {}
    for name, folder in folders:
        if folder not in names_by_folder and _is_folder(folder):
            names_by_folder[folder] = name
    return [(name, folder) for folder, name in list(names_by_folder.items())[:_MAX_PLACES]]


def _list_removable_drives() -> list[tuple[str, Path]]:
    """Returns the mounted removable drives, with their names."""
    drives = []
    for root in map(Path, _MOUNT_FOLDERS):
        for folder in _list_entries(root):
            inner = (
                [entry for entry in _list_entries(folder) if entry.is_mount()]
                if not folder.is_mount()
                else []
            )
            drives += [(entry.name, entry) for entry in (inner or [folder]) if entry.is_mount()]
    return drives


def _list_entries(folder: Path) -> list[Path]:
    """Returns the entries of a folder, or an empty list if it cannot be read."""
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:
        return False


@dataclass
class FileBrowser:
    """The state of an open or save dialogue.

    Attributes:
        folder: the listed folder.
        endings: selectable file extensions, with the dot. The first is appended to a name without extension.
        name: the typed or clicked file name.
        saving: if True, the file need not exist.
        project_path: the project's own file, which may be replaced without a confirmation.
        problem: the reason why the folder cannot be listed, or empty.
        refusal: the reason why the chosen name is rejected, or empty.
        awaits_retry: True if the dialogue waits for another name, or for a confirmation with Enter.
        order: sort order of the files.
        new_folder_name: name of the new folder while it is being typed; None otherwise.
    """

    folder: Path
    endings: tuple[str, ...]
    name: str = ""
    saving: bool = False
    project_path: Path | None = None
    problem: str = field(default="", init=False)
    refusal: str = field(default="", init=False)
    awaits_retry: bool = field(default=False, init=False)
    order: Order = field(default="name", init=False)
    new_folder_name: str | None = field(default=None, init=False)
    _warned: Path | None = field(default=None, init=False)

    def folders(self) -> list[Path]:
        """Returns the folders in the current folder, without hidden ones."""
        return [path for path in self._list_folder() if path.is_dir()]

    def files(self) -> list[Path]:
        """Returns the selectable files, in the chosen sort order."""
        selectable = [
            path for path in self._list_folder() if path.is_file() and path.suffix.lower() in self.endings
        ]
        if self.order == "newest":
            return sorted(selectable, key=lambda path: -_read_status(path)[1])
        return (
            sorted(selectable, key=lambda path: -_read_status(path)[0])
            if self.order == "largest"
            else selectable
        )

    def make_folder(self) -> None:
        """Creates the named folder, and lists it.

        Raises:
            InputError: if the name is not valid for a folder, or already exists.
            ResourceError: if the folder cannot be created.
        """
        name = (self.new_folder_name or "").strip()
        if not name or name in (".", "..") or any(letter in name for letter in '/\\:*?"<>|\0'):
            raise InputError(
                tr("a folder cannot have this name"), where="file", remedy=tr("Use letters and digits.")
            )
        new_folder = self.folder / name
        try:
            new_folder.mkdir()
        except FileExistsError:
            raise InputError(
                tr("{0} exists already", name), where="file", remedy=tr("Type another name.")
            ) from None
        except OSError as error:
            problem = tr("the folder cannot be created ({0})", error.strerror)
            raise ResourceError(problem, where=str(new_folder), remedy=tr("Choose another place.")) from None
        self.new_folder_name = None
        self.enter(new_folder)

    def enter(self, folder: Path) -> None:
        """Changes to another folder."""
        self.folder, self.name = folder.resolve(), "" if not self.saving else self.name

    def get_path(self) -> Path:
        """Returns the chosen path.

        Raises:
            InputError: if no name is given, if the file does not exist, or if an existing file would be
                replaced. A second call for the same file confirms that it is replaced.
        """
        name = self.name.strip()
        if not name:
            raise InputError(
                tr("no file is chosen"), where="file", remedy=tr("Click a file, or type a name.")
            )
        try:
            return self._find_path(name)
        # The name is too long, or it begins with "~" and an unknown user.
        except (OSError, RuntimeError, ValueError):
            raise InputError(
                tr("a file cannot have this name"), where="file", remedy=tr("Type a shorter name.")
            ) from None

    def _find_path(self, name: str) -> Path:
        if "\0" in name:
            raise ValueError(name)
        path = Path(name).expanduser()
        path = path if path.is_absolute() else self.folder / path
        if self.saving and path.suffix.lower() not in self.endings:
            path = path.with_name(path.name + self.endings[0])
        if not self.saving and not path.is_file():
            raise InputError(
                tr("the file does not exist"), where=str(path), remedy=tr("Choose another file.")
            )
        if self.saving and path.exists() and path not in (self.project_path, self._warned):
            self._warned = path
            raise InputError(
                tr("{0} exists already", path.name),
                where="file",
                remedy=tr("Press Save again to replace the file."),
            )
        return path

    def _list_folder(self) -> list[Path]:
        """Returns the entries of the folder, sorted by name, or an empty list if the folder
        cannot be read.
        """
        self.problem = ""
        try:
            entries = [path for path in self.folder.iterdir() if not path.name.startswith(".")]
        except OSError as error:
            self.problem = tr("The folder cannot be read ({0}).", error.strerror)
            return []
        return sorted(entries, key=lambda path: path.name.lower())


def _read_status(path: Path) -> tuple[int, float]:
    """Returns the size in bytes and the time of the last change. Both are 0 for a file that has
    been removed.
    """
    try:
        status = os.stat(path)
    except OSError:
        return 0, 0.0
    return status.st_size, status.st_mtime
