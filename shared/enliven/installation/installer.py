"""Executes an installation plan, and undoes it."""

from __future__ import annotations

import base64
import contextlib
import os
import shutil
import stat
import subprocess
from collections.abc import Callable
from pathlib import Path

import msgspec

from enliven.errors import InputError, ResourceError
from enliven.files import DECODE_ERRORS, read_file, write_file

from .install_plan import CONFIGURATION_FOLDER, STATE_FOLDER, InstallPlan, PlannedFile, command_line

KIOSK_USER = "enliven"
"""Name of the user that runs all programs of a kiosk."""
_RECORD_FILE = STATE_FOLDER / "installed.json"
"""Path of the file that lists all changes of an installation."""
_MAX_RECORD_FILE_BYTES = 1 << 26
"""Maximum size in bytes of this file. It contains the content of the files that the installation has
replaced."""


class _ReplacedFile(msgspec.Struct, frozen=True):
    """A file that an installation has written.

    Attributes:
        place: the file's path.
        content: content of the replaced file, as base64. None if the file is new.
        mode: permissions of the replaced file.
        link: target of the replaced symbolic link.
    """

    place: str
    content: str | None = None
    mode: int = 0o644
    link: str = ""


class _Manifest(msgspec.Struct, frozen=True):
    """The record of an installation.

    Attributes:
        files: the files, in the order in which they were written.
        folders: the created folders.
        units: the enabled units.
        made_user: True if the installation created the kiosk's user.
        recordings: folder of recordings, which is not removed. Empty if the kiosk does not record.
    """

    files: list[_ReplacedFile] = []
    folders: list[str] = []
    units: list[str] = []
    made_user: bool = False
    recordings: str = ""


class Installer:
    """Installs a kiosk into a system, and removes it.

    Args:
        root: root folder of the system. "/" is the running system. In another system, no programs are
            started.
        report: a function that prints each step.
    """

    def __init__(self, root: Path = Path("/"), report: Callable[[str], None] = print) -> None:
        self._root, self._say = root, report

    @property
    def is_installed(self) -> bool:
        """True if a kiosk is installed."""
        return self._target_path(_RECORD_FILE).is_file()

    def print_plan(self, plan: InstallPlan) -> None:
        """Prints all files with their content, and all commands, without changing anything."""
        for file in plan.files:
            if file.content is not None:
                self._say(f"# write {file.place}")
                self._say(file.content.decode())
            elif file.link:
                self._say(f"# link {file.place} -> {file.link}")
            else:
                self._say(f"# copy {file.source} -> {file.place}")
        if plan.recordings is not None:
            self._say(f"# create {plan.recordings}, which belongs to {KIOSK_USER}")
        for words in self._list_all_commands(plan):
            self._say(command_line(words))

    def install(self, plan: InstallPlan) -> None:
        """Writes all files and starts the units. A second installation replaces the first one.

        Raises:
            ResourceError: if a file cannot be written, or a command fails. All steps are recorded, so that
                :meth:`remove` undoes them.
        """
        old_manifest = self._read_manifest()
        made_user = old_manifest.made_user or not self._has_user()
        kept_entries = {entry.place: entry for entry in old_manifest.files}
        planned_places = {str(file.place) for file in plan.files}
        old_units = [unit for unit in old_manifest.units if unit not in plan.units]
        if old_units:
            self._disable_units(old_units)
        for entry in old_manifest.files:
            if entry.place not in planned_places:
                self._restore_file(entry)
        files = [
            kept_entries.get(str(file.place)) or self._record_original_file(file.place) for file in plan.files
        ]
        missing_folders = self._list_missing_folders(plan)
        folders = [
            *old_manifest.folders,
            *(folder for folder in missing_folders if folder not in old_manifest.folders),
        ]
        recordings = "" if plan.recordings is None else str(plan.recordings)
        # Write the record first, so that an interrupted installation can be removed.
        manifest = _Manifest(files, folders, list(plan.units), made_user, recordings)
        write_file(self._target_path(_RECORD_FILE), msgspec.json.encode(manifest))
        for file in plan.files:
            self._write_planned_file(file)
        for words in plan.setup_commands:
            self._run_command(self._command_in_root(words))
        self._give_to_user(plan)
        for words in self._list_all_commands(plan)[len(plan.setup_commands) :]:
            try:
                self._run_command(words)
            except ResourceError as error:
                if words not in plan.apply_commands:
                    raise
                # These commands apply new rules and limits immediately. If they fail, a restart of the
                # computer applies them.
                self._say(f"The command failed: {error.what}. Restart the computer to apply the change.")

    def remove(self) -> list[str]:
        """Stops the units, and restores every file. Recordings stay.

        Returns:
            The folders that were kept.

        Raises:
            InputError: if no kiosk is installed.
        """
        if not self.is_installed:
            raise InputError("no kiosk is installed", where=str(self._target_path(_RECORD_FILE)))
        manifest = self._read_manifest()
        self._disable_units(manifest.units)
        for entry in reversed(manifest.files):
            self._restore_file(entry)
        kept_folders = self._keep_recordings(manifest)
        self._remove_state(kept_folders)
        for folder in sorted(manifest.folders, key=len, reverse=True):
            # Keep folders that contain other files.
            with contextlib.suppress(OSError):
                self._target_path(Path(folder)).rmdir()
        if self._is_running:
            self._run_command(("systemctl", "daemon-reload"))
            self._run_command(("udevadm", "control", "--reload"))
        if manifest.made_user and self._has_user():
            self._run_command(self._command_in_root(("userdel", KIOSK_USER)))
        return [str(folder) for folder in kept_folders]

    @property
    def _is_running(self) -> bool:
        return self._root == Path("/")

    def _target_path(self, place: Path) -> Path:
        """Returns the location of an absolute path in the system that is changed."""
        return self._root / place.relative_to("/")

    def _list_all_commands(self, plan: InstallPlan) -> list[tuple[str, ...]]:
        """Returns all commands of an installation in order."""
        commands = [self._command_in_root(words) for words in plan.setup_commands]
        if not self._is_running:
            return [*commands, ("systemctl", f"--root={self._root}", "enable", *plan.units)]
        commands += [("systemctl", "daemon-reload"), *plan.apply_commands]
        commands.append(("systemctl", "enable", *plan.units))
        # Do not wait for the units, because the first start of an edge compiles for some minutes.
        return [*commands, ("systemctl", "restart", "--no-block", *plan.units)]

    def _command_in_root(self, words: tuple[str, ...]) -> tuple[str, ...]:
        """Returns a command for the system in ``root``. Programs such as systemd-sysusers and userdel have an
        option for this folder.
        """
        if self._is_running:
            return words
        option = f"--prefix={self._root}" if words[0] == "userdel" else f"--root={self._root}"
        return (words[0], option, *words[1:])

    def _run_command(self, words: tuple[str, ...]) -> None:
        """Runs a command.

        Raises:
            ResourceError: if the command is missing or fails.
        """
        self._say(command_line(words))
        try:
            completed = subprocess.run(words, capture_output=True, text=True, check=False)
        except OSError as error:
            raise ResourceError(error.strerror or "the command cannot be run", where=words[0]) from None
        if completed.returncode:
            lines = completed.stderr.strip().splitlines() or [f"exit code {completed.returncode}"]
            raise ResourceError(
                lines[-1],
                where=command_line(words),
                remedy="To undo all steps, run: enliven install-kiosk --remove",
            )

    def _disable_units(self, units: list[str]) -> None:
        """Stops and disables systemd units. Missing units are ignored."""
        words = ("systemctl", "disable", "--now", *units)
        if not self._is_running:
            words = ("systemctl", f"--root={self._root}", "disable", *units)
        with contextlib.suppress(ResourceError):
            self._run_command(words)

    def _record_original_file(self, place: Path) -> _ReplacedFile:
        """Returns the record of the file at a path before the installation."""
        path = self._target_path(place)
        if path.is_symlink():
            return _ReplacedFile(str(place), link=os.readlink(path))
        if path.is_file():
            mode = stat.S_IMODE(path.stat().st_mode)
            return _ReplacedFile(str(place), base64.b64encode(path.read_bytes()).decode(), mode)
        return _ReplacedFile(str(place))

    def _list_missing_folders(self, plan: InstallPlan) -> list[str]:
        """Returns the folders that the installation will create."""
        places = [*(file.place for file in plan.files), _RECORD_FILE]
        folders = {
            folder for place in places for folder in place.parents if not self._target_path(folder).exists()
        }
        return sorted(str(folder) for folder in folders)

    def _write_planned_file(self, file: PlannedFile) -> None:
        """Writes one file or link."""
        path = self._target_path(file.place)
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_symlink() or file.link:
            path.unlink(missing_ok=True)
        if file.link:
            path.symlink_to(file.link)
            return
        if file.content is not None:
            write_file(path, file.content)
        elif file.source is not None and file.source.resolve() != path.resolve():
            shutil.copyfile(file.source, path)
        path.chmod(0o600 if file.is_secret else 0o644)

    def _give_to_user(self, plan: InstallPlan) -> None:
        """Changes the owner of secrets and of the folder of recordings to the kiosk's user."""
        owner = self._user_and_group()
        for file in plan.files:
            if file.is_secret:
                os.chown(self._target_path(file.place), *owner)
        if plan.recordings is not None:
            folder = self._target_path(plan.recordings)
            if not folder.is_dir():
                folder.mkdir(parents=True, mode=0o750)
            os.chown(folder, *owner)
        os.chown(self._target_path(STATE_FOLDER), *owner)

    def _user_and_group(self) -> tuple[int, int]:
        """Returns the kiosk's user and group.

        Raises:
            ResourceError: if the user is missing.
        """
        for line in self._target_path(Path("/etc/passwd")).read_text().splitlines():
            fields = line.split(":")
            if fields[0] == KIOSK_USER:
                return int(fields[2]), int(fields[3])
        raise ResourceError(f"the user {KIOSK_USER} could not be created", where="systemd-sysusers")

    def _has_user(self) -> bool:
        """Returns True if the kiosk's user exists."""
        try:
            self._user_and_group()
        except (ResourceError, OSError):
            return False
        return True

    def _restore_file(self, entry: _ReplacedFile) -> None:
        """Restores the replaced file, or removes the installed file if there was none."""
        path = self._target_path(Path(entry.place))
        if entry.content is not None:
            if path.is_symlink():
                path.unlink()
            write_file(path, base64.b64decode(entry.content))
            path.chmod(entry.mode)
            return
        path.unlink(missing_ok=True)
        if entry.link:
            path.symlink_to(entry.link)

    def _keep_recordings(self, manifest: _Manifest) -> list[Path]:
        """Changes the owner of the recordings to root, and returns their folder if there are any. An empty
        folder is removed.
        """
        if not manifest.recordings:
            return []
        folder = self._target_path(Path(manifest.recordings))
        with contextlib.suppress(OSError):
            folder.rmdir()
        if not folder.is_dir():
            return []
        for path in (folder, *folder.rglob("*")):
            os.chown(path, 0, 0, follow_symlinks=False)
        return [Path(manifest.recordings)]

    def _remove_state(self, kept: list[Path]) -> None:
        """Removes all files that the programs wrote, except recordings."""
        state = self._target_path(STATE_FOLDER)
        if not state.is_dir():
            return
        for path in state.iterdir():
            if any(self._target_path(folder).is_relative_to(path) for folder in kept):
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink()
        with contextlib.suppress(OSError):
            state.rmdir()

    def _read_manifest(self) -> _Manifest:
        """Returns the record of the installation, or an empty record if nothing is installed.

        Raises:
            InputError: if the record is damaged.
        """
        path = self._target_path(_RECORD_FILE)
        if not path.is_file():
            return _Manifest()
        try:
            return msgspec.json.decode(read_file(path, _MAX_RECORD_FILE_BYTES), type=_Manifest)
        except DECODE_ERRORS:
            raise InputError(
                "the record of the installation is damaged",
                where=str(path),
                remedy=f"Delete this file and {CONFIGURATION_FOLDER}, and install the kiosk again.",
            ) from None
