"""Writes files and folders completely or not at all."""

from __future__ import annotations

import contextlib
import difflib
import errno
import glob
import io
import os
import secrets
import shutil
import stat
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from enliven.errors import InputError, ResourceError
from enliven.files.faults import explain_write_errors, file_fault

_CREATE_FLAGS = (
    os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
)
"""Flags that create a new file. They prevent opening an existing file and following a link."""
_OVERWRITE_FLAGS = os.O_RDWR | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
PART_SUFFIX = ".part"
"""Suffix of a temporary file that is not written completely yet."""
_MAX_PART_NAME_LENGTH = 40
"""Maximum number of characters of a file's name that become part of the name of its temporary file. File
systems allow 255 bytes in total.
"""
_MAX_WRITE_S = 86_400.0
"""Maximum duration of a write in seconds (a day). An older temporary file was left behind by a killed
program."""


def require_folder(*paths: Path | None) -> None:
    """Raises ResourceError if the folder of an output file is missing. Call it before any work begins. Paths
    that are None are ignored.

    Raises:
        ResourceError: if a folder is missing. The message contains the most similar existing name.
    """
    for path in paths:
        folder = Path() if path is None else path.parent
        try:
            is_folder = folder.is_dir()
        except OSError as error:
            raise file_fault(error, folder, "used") from None
        if not is_folder:
            siblings: list[str] = []
            with contextlib.suppress(OSError):
                siblings = [sibling.name for sibling in folder.parent.iterdir()]
            similar = difflib.get_close_matches(folder.name, siblings, n=1)
            suggestion = f"Did you mean {folder.with_name(similar[0])}? " if similar else ""
            problem, remedy = (
                f"the folder {str(folder)!r} does not exist",
                f"{suggestion}Create the folder, or check its name.",
            )
            raise ResourceError(problem, where=str(path), remedy=remedy)


def write_file(path: Path, data: bytes | str, remedy: str = "", *, durable: bool = True) -> None:
    """Writes a file completely or not at all. Text is encoded as UTF-8. Creates the folder if it is missing.

    Pipes and devices are written directly. :func:`replace_file` lists what is preserved of a replaced file.

    Args:
        remedy: the remedy if it cannot be written. If empty, it depends on the kind of failure.
        durable: True waits until the data is on the disk. False is for files that may be lost when the
            computer restarts.

    Raises:
        ResourceError: if it cannot be written. The existing file is then untouched.
    """
    content = data.encode() if isinstance(data, str) else data
    with explain_write_errors(path, remedy):
        if _is_stream(path):
            path.write_bytes(content)
            return
        path.parent.mkdir(parents=True, exist_ok=True)
    replaced = replace_file(path, remedy, durable=durable)
    with replaced as part, explain_write_errors(path, remedy), part.open("r+b") as file:
        file.write(content)


def write_picture(path: Path, picture: Any, remedy: str = "", **options: Any) -> None:
    """Writes a Pillow image by :func:`write_file`, in the format of the path's suffix.

    Args:
        options: options of Pillow's writer.

    Raises:
        InputError: if Pillow does not support the suffix.
        ResourceError: if it cannot be written. The existing file is then untouched.
    """
    from PIL import Image  # Imported here, because only image files need Pillow, and it is slow to load.

    kind = Image.registered_extensions().get(path.suffix.lower())
    if kind not in Image.SAVE:
        raise InputError(
            f"images cannot be written to {path.suffix or 'extensionless'} files",
            where=str(path),
            remedy="Known image formats: png, jpg, webp.",
        )
    encoded = io.BytesIO()
    picture.save(encoded, kind, **options)
    write_file(path, encoded.getvalue(), remedy)


@contextlib.contextmanager
def replace_file(path: Path, remedy: str = "", *, durable: bool = True) -> Iterator[Path]:
    """Yields the path of an empty file to write. At the end of the ``with`` block, it replaces ``path``,
    unless an exception was raised.

    The mode, the owner and the extended attributes of the existing file are preserved. A symbolic link stays,
    and its target is replaced. The temporary file is in the same folder. Its name cannot be guessed, and an
    existing file is never opened.

    Args:
        remedy: the remedy if it cannot be written. If empty, it depends on the kind of failure.
        durable: as in :func:`write_file`.

    Raises:
        ResourceError: if it cannot be written. The existing file is then untouched.
    """
    part = None
    try:
        with explain_write_errors(path, remedy):
            target = Path(os.path.realpath(path)) if path.is_symlink() else path
            old_stat = _stat_regular(target)
            _remove_leftovers(target)
            require_folder(target)
            part = _create_part(target, 0o666 if old_stat is None else 0o600)
        yield part
        with explain_write_errors(path, remedy):
            _replace_target(part, target, old_stat, durable)
    except BaseException:
        if part is not None:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
        raise


@contextlib.contextmanager
def replace_folder(path: Path, is_own: Callable[[str], bool], remedy: str = "") -> Iterator[Path]:
    """Yields the path of an empty folder to fill. At the end of the ``with`` block, it replaces ``path``,
    unless an exception was raised.

    The temporary folder is next to ``path``. An existing folder is only replaced if all of its content are
    regular files of an earlier call, so that no other file is ever deleted.

    Args:
        is_own: a function that returns True for the name of a file that an earlier call may have written.
        remedy: the remedy if it cannot be written. If empty, it depends on the kind of failure.

    Raises:
        InputError: if the path is not a folder, or the folder contains other files.
        ResourceError: if it cannot be written. An existing folder is then untouched.
    """
    require_folder(path)
    _refuse_foreign_files(path, is_own)
    part = old = None
    try:
        with explain_write_errors(path, remedy):
            _remove_leftovers(path)
            part = _create_part_folder(path)
        with explain_write_errors(path, remedy):
            yield part
            if path.exists():
                _refuse_foreign_files(path, is_own)
                old = _create_part_folder(path)
                os.replace(path, old)
            os.replace(part, path)
    except BaseException:
        if old is not None and not path.exists():
            with contextlib.suppress(OSError):
                os.replace(old, path)
        if part is not None:
            shutil.rmtree(part, ignore_errors=True)
        raise
    finally:
        if old is not None:
            shutil.rmtree(old, ignore_errors=True)


def _refuse_foreign_files(path: Path, is_own: Callable[[str], bool]) -> None:
    """Raises InputError if a path exists, but is not a folder that contains only files for which ``is_own``
    returns True."""
    remedy = "Choose another name."
    try:
        if not path.is_symlink() and not path.exists():
            return
        if path.is_symlink() or not path.is_dir():
            raise InputError("the path exists, but is not a folder", where=str(path), remedy=remedy)
        foreign = [
            file.name
            for file in path.iterdir()
            if file.is_symlink() or not file.is_file() or not is_own(file.name)
        ]
    except OSError as error:
        raise file_fault(error, path, "used") from None
    if foreign:
        problem = f"the folder contains other files, such as {min(foreign)!r}, so it is not replaced"
        raise InputError(problem, where=str(path), remedy=remedy)


def _is_stream(path: Path) -> bool:
    """Returns True if the path is a pipe or a device, such as /dev/stdout."""
    try:
        kind = path.stat().st_mode
    except (OSError, ValueError):
        return False
    return not (stat.S_ISREG(kind) or stat.S_ISDIR(kind))


def _stat_regular(path: Path) -> os.stat_result | None:
    """Returns the status (``os.stat``) of the file that will be replaced, or None if it does not exist.

    Raises:
        OSError: if the path is a folder, a pipe or a device.
    """
    try:
        state = path.stat()
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(state.st_mode):
        code = errno.EISDIR if stat.S_ISDIR(state.st_mode) else errno.EINVAL
        raise OSError(code, os.strerror(code))
    return state


def _part_path(target: Path) -> Path:
    """Returns a path for a temporary file in the same folder as ``target``. Its random name cannot be
    predicted by other users.
    """
    return target.with_name(f".{target.name[:_MAX_PART_NAME_LENGTH]}.{secrets.token_hex(8)}{PART_SUFFIX}")


def _create_part_folder(target: Path) -> Path:
    """Creates an empty temporary folder next to ``target``."""
    while True:
        part = _part_path(target)
        try:
            part.mkdir()
        except FileExistsError:
            continue
        return part


def _create_part(target: Path, mode: int) -> Path:
    """Creates an empty temporary file next to ``target``."""
    while True:
        part = _part_path(target)
        try:
            os.close(os.open(part, _CREATE_FLAGS, mode))
        except FileExistsError:
            continue
        return part


def _remove_leftovers(target: Path) -> None:
    """Removes the temporary files and folders of ``target`` that are more than a day old, because their
    program was killed."""
    oldest = time.time() - _MAX_WRITE_S
    for part in target.parent.glob(f".{glob.escape(target.name[:_MAX_PART_NAME_LENGTH])}.*{PART_SUFFIX}"):
        with contextlib.suppress(OSError):
            state = part.lstat()
            if state.st_mtime < oldest and stat.S_ISDIR(state.st_mode):
                shutil.rmtree(part, ignore_errors=True)
            elif state.st_mtime < oldest:
                part.unlink()


def _replace_target(part: Path, target: Path, old_attributes: os.stat_result | None, durable: bool) -> None:
    """Replaces ``target`` by the finished file ``part``, and preserves the attributes of ``target``."""
    with part.open("r+b") as file:
        has_attributes = old_attributes is None or _copy_attributes(file.fileno(), target, old_attributes)
        if durable:
            os.fsync(file.fileno())
    if has_attributes:
        os.replace(part, target)
    else:  # Replacing the file would change its owner, so overwrite its content instead.
        _overwrite_target(part, target)


def _copy_attributes(descriptor: int, target: Path, old_attributes: os.stat_result) -> bool:
    """Copies owner, mode and extended attributes of the existing file ``target`` to a new file.

    Returns:
        False if this user has no permission to set the owner.
    """
    if sys.platform == "win32":
        # On Windows, a new file inherits the permissions of its folder, so there is nothing to copy.
        return True
    current = os.fstat(descriptor)
    if (current.st_uid, current.st_gid) != (old_attributes.st_uid, old_attributes.st_gid):
        try:
            os.fchown(descriptor, old_attributes.st_uid, old_attributes.st_gid)
        except OSError:
            return False
    if hasattr(os, "listxattr"):
        with contextlib.suppress(OSError):  # Not every file system supports extended attributes.
            for name in os.listxattr(target):
                with contextlib.suppress(OSError):
                    # Some attributes are reserved for the system and cannot be set.
                    os.setxattr(descriptor, name, os.getxattr(target, name))
    os.fchmod(descriptor, stat.S_IMODE(old_attributes.st_mode))
    return True


def _overwrite_target(part: Path, target: Path) -> None:
    """Copies the content of a finished file to an existing file with a different owner, after reserving the
    space."""
    with part.open("rb") as new, os.fdopen(os.open(target, _OVERWRITE_FLAGS), "r+b") as old:
        size = os.fstat(new.fileno()).st_size
        if size and hasattr(os, "posix_fallocate"):
            os.posix_fallocate(old.fileno(), 0, size)
        shutil.copyfileobj(new, old)
        old.truncate()
        old.flush()
        os.fsync(old.fileno())
    part.unlink()
