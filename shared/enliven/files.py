"""Reads and writes files safely. Checks the size of a file before reading, and limits references between
files to the same folder.

:func:`read_file` reads a file completely. :func:`write_file` and :func:`replace_file` write an output file
completely or not at all. :func:`replace_folder` does the same for a folder of files. :class:`ReferencedFiles`
opens the files that another file refers to (buffers and images of a glTF, materials and textures of an OBJ).
These must be regular files of limited size in the folder of the first file or below it. Pipes, devices, links
to other folders and paths that leave the folder raise an error.
"""

from __future__ import annotations

import base64
import codecs
import contextlib
import difflib
import errno
import glob
import io
import locale
import os
import secrets
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any, BinaryIO, Literal
from urllib.parse import unquote, unquote_to_bytes

from enliven.errors import EnlivenError, InputError, ResourceError, find_plain_reason

if sys.platform != "win32":
    import fcntl

MAX_FILE_BYTES = 1 << 31
"""Maximum size in bytes of a file that is read completely, and of all files that it refers to. A scan of 20
million triangles with its images is smaller, and the memory of a small machine is larger.
"""
DAMAGE = (
    LookupError,
    TypeError,
    ValueError,
    AttributeError,
    ArithmeticError,
    MemoryError,
    RecursionError,
)
"""The exceptions that parsers raise if the numbers in a file are damaged. Readers catch them, because checks
of each number would be most of a reader's code.
"""
DECODE_ERRORS = (ValueError, RecursionError)
"""The exceptions of msgspec's decoders for damaged JSON or MessagePack. Those of msgspec are ValueErrors.
So is the error for text that is not UTF-8.
"""
_READ_FLAGS = (
    os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
)
"""Flags for opening a file for reading. With them, opening a pipe without a writer does not block, so the
pipe can be refused."""
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
_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
"""Byte order marks and the encodings that they mean. UTF-32 precedes UTF-16, because its mark starts with the
mark of UTF-16.
"""
_USUAL_CODE_PAGE = "cp1252"
"""The 8-bit code page that is assumed on computers that use UTF-8. Most old files are from Windows in western
Europe or America.
"""
_FOLDER_PREFIX = "enliven-capture-"
"""Prefix of the names of temporary folders. Older versions used the same prefix."""
_LOCK_NAME = ".in-use"
"""Name of the lock file in a temporary folder. The process that uses the folder keeps it locked."""
_MIN_ABANDONED_AGE_S = 86_400.0
"""Minimum age in seconds (a day) at which a temporary folder without a lock file counts as abandoned."""
_WRITE_ADVICE = "Check the folder's permissions and the space on the disk."
_FAILING_DISK_ADVICE = (
    "The disk or memory card may be failing. Check it, and copy the readable files to another disk."
)
_DISCONNECTED_ADVICE = (
    "The network drive or device does not answer. Connect it again, or copy the file to this computer."
)
_FULL_DISK_ADVICE = "Free some space on the disk, or choose a folder on another disk."
_DEVICE_FAULTS = {
    number: remedy
    for remedy, names in (
        (_FAILING_DISK_ADVICE, ("EIO", "EUCLEAN", "EBADMSG", "EILSEQ", "EMEDIUMTYPE", "ENOMEDIUM")),
        (
            _DISCONNECTED_ADVICE,
            ("ESTALE", "ENODEV", "ENXIO", "EREMOTEIO", "ETIMEDOUT", "EHOSTDOWN", "ENOTCONN", "ESHUTDOWN"),
        ),
        (_FULL_DISK_ADVICE, ("ENOSPC", "EDQUOT", "EFBIG")),
        ("The disk is read-only. Choose a folder on another disk.", ("EROFS",)),
        ("Close other programs, or raise the limit of open files (ulimit -n).", ("EMFILE", "ENFILE")),
    )
    for name in names
    if (number := getattr(errno, name, None)) is not None
}
"""The remedy for each error number that means an error of a device or of this machine, and not of a file."""
_PERMISSION_ERRORS = {errno.EACCES, errno.EPERM}
"""Error numbers that mean that the user has no permission for a file."""
INVALID_NAME_REASON = "this file name is not valid"
"""The reason in messages about a path that the operating system refuses without a reason."""
_SAME_FOLDER_ADVICE = "Store all files of the model in one folder."


def file_fault(
    error: OSError, path: Path | str, doing: Literal["read", "written", "listed", "used"] = "read"
) -> EnlivenError:
    """Converts the error of a failed operation on a file or folder to an error for users, with its path and a
    remedy.

    Args:
        doing: the failed operation as a participle, such as "read" in "it cannot be read".

    Returns:
        ResourceError for an error of the device or of this machine, and for all failed writes. Otherwise
        InputError.
    """
    problem = f"it cannot be {doing} ({error.strerror or error})"
    remedy = _DEVICE_FAULTS.get(error.errno or 0)
    if remedy is not None:
        return ResourceError(problem, where=str(path), remedy=remedy)
    if doing == "written":
        return ResourceError(problem, where=str(path), remedy=_WRITE_ADVICE)
    remedy = (
        "Check the permissions of the file or folder."
        if error.errno in _PERMISSION_ERRORS
        else "Choose a readable file."
    )
    return InputError(problem, where=str(path), remedy=remedy)


def is_file_fault(error: OSError) -> bool:
    """Returns True if an operating system error concerns a file, a folder or their device."""
    number = error.errno or 0
    is_device = number in _DEVICE_FAULTS and not isinstance(error, ConnectionError | TimeoutError)
    return is_device or error.filename is not None or number in _PERMISSION_ERRORS


class _ReportedFile(io.FileIO):
    """A file that is opened for reading. A failed read raises the error that :func:`file_fault` returns."""

    def readinto(self, buffer: bytearray | memoryview) -> int | None:  # type: ignore[override]
        try:
            return super().readinto(buffer)
        except OSError as error:
            raise file_fault(error, str(self.name)) from None

    def readall(self) -> bytes:
        try:
            return super().readall()
        except OSError as error:
            raise file_fault(error, str(self.name)) from None


class TemporaryFolder(tempfile.TemporaryDirectory[str]):
    """A folder in the system's temporary folder. It is removed at the end, or after a crash by a later start.

    While the process runs, it keeps a file in the folder locked. The operating system releases the lock when
    the process ends. On Windows the folder is not removed after a crash.

    Args:
        purpose: a word that becomes part of the folder's name.
    """

    def __init__(self, purpose: str) -> None:
        remove_dead_folders()
        super().__init__(prefix=f"{_FOLDER_PREFIX}{purpose}-", ignore_cleanup_errors=True)
        self._lock = -1
        if sys.platform != "win32":
            self._lock = os.open(Path(self.name) / _LOCK_NAME, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def cleanup(self) -> None:
        """Removes the folder. A second call does nothing."""
        super().cleanup()
        lock, self._lock = self._lock, -1
        if lock >= 0:
            os.close(lock)


def remove_dead_folders() -> list[str]:
    """Removes this user's temporary folders that killed processes have left behind. Returns their names.

    A folder without a lock file was left behind by an older version, or is being created. It is removed if it
    is older than a day. Symbolic links are not followed.
    """
    if sys.platform == "win32":
        return []
    removed = []
    with contextlib.suppress(OSError), _open_folder(tempfile.gettempdir()) as temporary:
        for name in os.listdir(temporary):
            if not name.startswith(_FOLDER_PREFIX):
                continue
            with contextlib.suppress(OSError), _open_folder(name, temporary) as folder:
                if os.fstat(folder).st_uid == os.geteuid() and _is_dead(folder):
                    shutil.rmtree(name, dir_fd=temporary)
                    removed.append(name)
    return removed


@contextlib.contextmanager
def _open_folder(name: str, within: int | None = None) -> Iterator[int]:
    """Opens a folder, and yields its descriptor for the parameter ``dir_fd``. Refuses links to folders."""
    links = 0 if within is None else os.O_NOFOLLOW
    descriptor = os.open(name, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC | links, dir_fd=within)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _is_dead(folder: int) -> bool:
    """Returns True if the process that created a :class:`TemporaryFolder` has ended. ``folder`` is its
    descriptor."""
    try:
        lock = os.open(_LOCK_NAME, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=folder)
    except FileNotFoundError:
        return time.time() - os.fstat(folder).st_mtime > _MIN_ABANDONED_AGE_S
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(lock)
    return True


def user_data_folder() -> Path:
    """Returns the user's folder for data that programs store between runs."""
    configured = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(configured) if configured else Path.home() / ".local" / "state") / "enliven"


def config_folder() -> Path:
    """Returns the user's folder for configuration files, such as keys."""
    folder_name = os.environ.get("XDG_CONFIG_HOME") or os.environ.get("APPDATA")
    return (Path(folder_name) if folder_name else Path.home() / ".config") / "enliven"


def open_file(path: Path) -> BinaryIO:
    """Opens a regular file for reading.

    If a later read fails, it raises the error that :func:`file_fault` returns.

    Raises:
        InputError: if the file is missing or not readable, or is a folder, a pipe or a device.
        ResourceError: if its device fails.
    """
    try:
        descriptor = os.open(path, _READ_FLAGS)
    except FileNotFoundError:
        raise InputError("the file does not exist", where=str(path), remedy="Check the path.") from None
    except OSError as error:
        raise file_fault(error, path) from None
    except ValueError:
        remedy = "Choose a readable file."
        raise InputError(
            f"it cannot be read ({INVALID_NAME_REASON})", where=str(path), remedy=remedy
        ) from None
    kind = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(kind):
        os.close(descriptor)
        problem = (
            "the path is a folder, not a file"
            if stat.S_ISDIR(kind)
            else "the path is a pipe or a device, not a regular file"
        )
        raise InputError(problem, where=str(path), remedy="Choose a readable file.")
    return io.BufferedReader(_ReportedFile(str(path), "rb", opener=lambda *_: descriptor))


def is_file(path: Path | str) -> bool:
    """Returns True for an existing regular file.

    It returns False for a name that is too long, or in a folder that cannot be read. :meth:`Path.is_file`
    raises an OSError for these. A later :func:`read_file` then reports the reason.
    """
    return os.path.isfile(path)


def read_file(path: Path, max_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Reads the bytes of a regular file of at most ``max_bytes`` bytes.

    Raises:
        InputError: in the cases of :func:`open_file`, or if the file is larger.
        ResourceError: if its device fails.
    """
    with open_file(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > max_bytes:
            problem = f"the file has {size} bytes, but at most {max_bytes} are allowed"
            raise InputError(problem, where=str(path), remedy="Use a smaller file.")
        return file.read(size)


def decode_text(data: bytes) -> str:
    """Decodes a text file of another program. Every line of the result ends in "\\n".

    If there is a byte order mark, it determines the encoding. Otherwise the encoding is UTF-8 if the bytes
    are valid UTF-8, and else the computer's 8-bit code page. All byte sequences can be decoded, so different
    names stay different.
    """
    for mark, encoding in _BYTE_ORDER_MARKS:
        if data.startswith(mark):
            text = data[len(mark) :].decode(encoding, "replace")
            break
    else:
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError:
            text = _decode_code_page(data)
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text


def text_bytes(data: bytes) -> bytes:
    """Converts a text file to bytes in which each line ends in b"\\n" and ASCII characters are single bytes.

    Readers of large files search these bytes and decode only names, by :func:`decode_text`. The bytes are
    UTF-8 or in the file's 8-bit code page.
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, codecs.BOM_UTF32_LE)):
        return decode_text(data).encode()
    data = data.removeprefix(codecs.BOM_UTF8)
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def _decode_code_page(data: bytes) -> str:
    """Decodes bytes in the locale's 8-bit code page, or in Latin-1 if the code page does not define all of
    them.
    """
    code_page = codecs.lookup(locale.getpreferredencoding(False)).name
    is_single_byte = code_page.startswith(("cp125", "iso8859", "koi8", "mac"))
    try:
        return data.decode(code_page if is_single_byte else _USUAL_CODE_PAGE)
    except UnicodeDecodeError:
        return data.decode("latin-1")


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


@contextlib.contextmanager
def explain_write_errors(path: Path, remedy: str) -> Iterator[None]:
    """Converts operating system errors in the ``with`` block to an error that contains the file and the
    remedy."""
    try:
        yield
    except OSError as error:
        fault = file_fault(error, path, "written")
        raise ResourceError(fault.what, where=fault.where, remedy=remedy or fault.remedy) from None


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


_recorded_references: ContextVar[list[Path] | None] = ContextVar("references", default=None)
"""The paths that :func:`record_references` collects in this thread, or None."""


@contextlib.contextmanager
def record_references() -> Iterator[list[Path]]:
    """Collects the absolute paths of all files that are opened by reference from other files in this thread,
    including missing files.

    A cache needs these paths, because an entry is outdated if one of the files has changed.
    """
    paths: list[Path] = []
    token = _recorded_references.set(paths)
    try:
        yield paths
    finally:
        _recorded_references.reset(token)


class ReferencedFiles:
    """Opens the files that another file refers to, if they are in its folder or below.

    Args:
        path: path of the file that refers to the others.
        max_bytes: maximum total size of all reads in bytes. A file that is referred to a thousand times
            counts a thousand times.
    """

    def __init__(self, path: Path, max_bytes: int = MAX_FILE_BYTES) -> None:
        self._path, self._left = path, max_bytes

    def read_uri(self, uri: str) -> bytes:
        """Returns the bytes of a data URI, or of the file at a percent-encoded relative URI.

        Raises:
            InputError: in the cases of :meth:`read_named_file`, or if the URI contains invalid data.
        """
        if not uri.startswith("data:"):
            return self.read_named_file(unquote(uri))
        head, _, body = uri.partition(",")
        try:
            return base64.b64decode(body) if head.endswith(";base64") else unquote_to_bytes(body)
        except ValueError:
            raise self._reference_error(
                uri, "contains data that cannot be decoded", "Export the model again."
            ) from None

    def read_named_file(self, name: str) -> bytes:
        """Returns the bytes of a file by its name, relative to the folder.

        Raises:
            InputError: if it is outside of the folder, missing or not a regular file, or exceeds the byte
                limit together with earlier reads.
        """
        try:
            folder = self._path.parent.resolve()
            target = (folder / name).resolve()
            if not target.is_relative_to(folder):
                raise self._reference_error(
                    name, "is outside of the folder of the model", _SAME_FOLDER_ADVICE
                )
            if (recorded := _recorded_references.get()) is not None:
                recorded.append(target)
            data = read_file(target, self._left)
        except InputError as error:
            if error.where == str(self._path):
                raise
            raise self._reference_error(name, f"cannot be read ({error.what})", _SAME_FOLDER_ADVICE) from None
        except (OSError, ValueError, RuntimeError) as error:
            # Symbolic links form a loop, or the name is invalid.
            raise self._reference_error(
                name, f"cannot be read ({find_plain_reason(error, INVALID_NAME_REASON)})", _SAME_FOLDER_ADVICE
            ) from None
        self._left -= len(data)
        return data

    def _reference_error(self, name: str, problem: str, remedy: str) -> InputError:
        return InputError(
            f"the referenced file {name[:80]!r} {problem}", where=str(self._path), remedy=remedy
        )
