"""A file browser without a window: a folder, what of it can be chosen, and a name."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from enliven.errors import InputError


@dataclass
class FileBrowser:
    """The state of an open or save dialogue.

    Attributes:
        folder: that is listed.
        endings: of files that can be chosen, with the dot; the first is added to a name without one.
        name: what is typed or clicked.
        saving: a name that is not there is allowed.
        own: a file that may be replaced without asking: the project's own.
        problem: why the folder cannot be listed, or empty.
        said: what is wrong with what was chosen, or empty.
        again: a name is to be typed, or Enter to be pressed, once more.
    """

    folder: Path
    endings: tuple[str, ...]
    name: str = ""
    saving: bool = False
    own: Path | None = None
    problem: str = field(default="", init=False)
    said: str = field(default="", init=False)
    again: bool = field(default=False, init=False)
    _warned: Path | None = field(default=None, init=False)

    def folders(self) -> list[Path]:
        """Folders in the folder, without hidden ones."""
        return [path for path in self._listed() if path.is_dir()]

    def files(self) -> list[Path]:
        """Files that can be chosen."""
        return [path for path in self._listed() if path.is_file() and path.suffix.lower() in self.endings]

    def enter(self, folder: Path) -> None:
        """List another folder."""
        self.folder, self.name = folder.resolve(), "" if not self.saving else self.name

    def chosen(self) -> Path:
        """The path that is chosen.

        Raises:
            InputError: where nothing is, or it is not there; once, where a file would be replaced.
        """
        name = self.name.strip()
        if not name:
            raise InputError("no file is chosen", where="file", mend="Click one, or type a name.")
        path = Path(name).expanduser()
        path = path if path.is_absolute() else self.folder / path
        if self.saving and path.suffix.lower() not in self.endings:
            path = path.with_name(path.name + self.endings[0])
        if not self.saving and not path.is_file():
            raise InputError("there is no such file", where=str(path), mend="Choose another.")
        if self.saving and path.exists() and path not in (self.own, self._warned):
            self._warned = path
            raise InputError(
                f"{path.name} is there already", where="file", mend="Press Save again to replace it."
            )
        return path

    def _listed(self) -> list[Path]:
        """The entries of the folder, by name; none where it cannot be read."""
        self.problem = ""
        try:
            found = [path for path in self.folder.iterdir() if not path.name.startswith(".")]
        except OSError as error:
            self.problem = f"The folder cannot be read ({error.strerror})."
            return []
        return sorted(found, key=lambda path: path.name.lower())
