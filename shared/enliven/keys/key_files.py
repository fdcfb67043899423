"""Reads and writes the key files of this user: the own key pair, paired viewers and paired edges.

The folder ``enliven/keys`` in the user's configuration folder contains:

- ``load_own_pair.toml``: the key pair of this user on this computer, for the edge and for viewers
- ``viewers/FINGERPRINT.toml``: a viewer that may connect to edges of this user, with its role
- ``edges/FINGERPRINT.ADDRESS.toml``: an edge that this user has paired with, with its address

Only its owner can read a file (mode 0600). Files are written completely or not at all.
"""

from __future__ import annotations

import contextlib
import hashlib
import ipaddress
import os
import re
import secrets
import stat
import struct
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from enliven.errors import EnlivenError, InputError
from enliven.files import config_folder, file_fault
from enliven.keys.roles import ROLES, Role
from enliven.settings import read_toml

KEY_BYTES = 32
"""Size in bytes of a public or secret key of Curve25519."""
_Z85_KEY_LENGTH = 40
"""Length of a key as text in Z85, the encoding that ZeroMQ uses for keys."""
_FINGERPRINT_DIGITS = 32
"""Number of hexadecimal digits of a fingerprint. 128 bits distinguish keys, even if an attacker generates
them.
"""
_MAX_PEERS = 1000
"""Maximum number of paired viewers, and of paired edges, that are read."""
_MAX_NAME_LENGTH = 64
"""Maximum length of a peer's name in characters."""
_OTHER_USERS_MODE_MASK = stat.S_IRWXG | stat.S_IRWXO
"""Permission bits of the group and of all other users."""
_NEW_FILE_FLAGS = (
    os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
)
"""Flags that create a new file. They prevent opening an existing file and following a link."""
_NEW_KEYS_ADVICE = (
    "Create new keys: enliven keys make --overwrite. Then pair again with each viewer and edge."
)


@dataclass(frozen=True)
class KeyPair:
    """A public and a secret key of Curve25519, 32 bytes each."""

    public: bytes
    secret: bytes = field(repr=False)


@dataclass(frozen=True)
class PairedViewer:
    """A viewer that may connect. ``paired`` is the date of the pairing, such as "2026-11-29"."""

    public: bytes
    name: str
    role: Role
    paired: str = ""


@dataclass(frozen=True)
class PairedEdge:
    """An edge that this user has paired with, and the address that was used for it.

    Attributes:
        public: the edge's public key.
        name: the edge's name.
        host: the address of the edge, as entered by the user.
        control_port: the edge's port for requests.
        role: the granted role.
        paired: date of the pairing.
    """

    public: bytes
    name: str
    host: str
    control_port: int
    role: Role
    paired: str = ""


def fingerprint(public: bytes) -> str:
    """Returns the fingerprint of a public key: eight groups of four hexadecimal digits of its SHA-256."""
    digits = hashlib.sha256(public).hexdigest()[:_FINGERPRINT_DIGITS]
    return "-".join(digits[k : k + 4] for k in range(0, _FINGERPRINT_DIGITS, 4))


def make_key_pair() -> KeyPair:
    """Creates a new key pair without storing it."""
    import zmq

    public, secret = zmq.curve_keypair()
    return KeyPair(_from_z85(public), _from_z85(secret))


def is_loopback(host: str) -> bool:
    """Returns True if an address or name is loopback: 127.0.0.1, ::1 or localhost. Does not resolve names."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


class KeyStore:
    """The key files of a folder. Files with wrong permissions or damaged content are refused.

    Args:
        folder: folder of the files. None means ``enliven/keys`` in the user's configuration folder.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder or config_folder() / "keys"

    @property
    def own_path(self) -> Path:
        """The path of the file with the user's own key pair."""
        return self.folder / "own.toml"

    def load_own_pair(self) -> KeyPair | None:
        """Returns the user's own key pair, or None if there is none.

        Raises:
            InputError: if the file is damaged, belongs to another user, or is readable by other users.
        """
        import zmq

        table = _read_private(self.own_path, _NEW_KEYS_ADVICE)
        if table is None:
            return None
        keys = KeyPair(
            _key_from_table(table, "public", self.own_path), _key_from_table(table, "secret", self.own_path)
        )
        if zmq.curve_public(_z85_text(keys.secret)) != _z85_text(keys.public):
            raise InputError(
                "the secret key does not belong to the public key",
                where=str(self.own_path),
                remedy=_NEW_KEYS_ADVICE,
            )
        return keys

    def create_own_pair(self, *, overwrite: bool = False) -> KeyPair:
        """Creates a new key pair and stores it. Raises the errors of :meth:`store_own`."""
        pair = make_key_pair()
        self.store_own(pair, overwrite=overwrite)
        return pair

    def store_own(self, pair: KeyPair, *, overwrite: bool = False) -> None:
        """Stores the user's own key pair.

        Raises:
            InputError: if a key pair exists already, unless ``overwrite`` is set.
            ResourceError: if the file cannot be written.
        """
        lines: dict[str, str | int] = {
            "public": _z85_text(pair.public).decode(),
            "secret": _z85_text(pair.secret).decode(),
        }
        _write_private(self.own_path, _toml_text(lines), overwrite=overwrite)

    def load_viewers(self, problems: list[str] | None = None) -> dict[bytes, PairedViewer]:
        """Returns the paired viewers by public key.

        Args:
            problems: list to which a sentence about each unusable file is appended. If None, an unusable file
                raises an error.

        Raises:
            InputError: if a file is damaged, belongs to another user, or is readable by other users.
        """
        tables = self._read_tables("viewers", problems)
        viewers = [
            _read_checked(path, problems, lambda p=path, t=table: _viewer_from_table(t, p))
            for path, table in tables
        ]
        return {viewer.public: viewer for viewer in viewers if viewer is not None}

    def load_edges(self, problems: list[str] | None = None) -> list[PairedEdge]:
        """Returns the paired edges. Arguments and errors are those of :meth:`load_viewers`."""
        tables = self._read_tables("edges", problems)
        edges = [
            _read_checked(path, problems, lambda p=path, t=table: _edge_from_table(t, p))
            for path, table in tables
        ]
        return [edge for edge in edges if edge is not None]

    def find_edge(self, host: str, control_port: int) -> PairedEdge | None:
        """Returns the edge that was paired at an address, or None.

        Raises:
            InputError: in the cases of :meth:`load_edges`.
        """
        place = (host.lower(), control_port)
        return next((e for e in self.load_edges() if (e.host.lower(), e.control_port) == place), None)

    def server_key(self, host: str, control_port: int) -> bytes | None:
        """Returns the expected public key of the edge at an address, or None if the edge uses no keys.

        An edge on this computer uses the user's own key pair if there is one.

        Raises:
            InputError: in the cases of :meth:`load_own_pair` and :meth:`load_edges`.
        """
        edge = self.find_edge(host, control_port)
        if edge is not None:
            return edge.public
        own_keys = self.load_own_pair() if is_loopback(host) else None
        return None if own_keys is None else own_keys.public

    def add_viewer(self, viewer: PairedViewer) -> None:
        """Stores a paired viewer. Replaces a stored viewer with the same key.

        Raises:
            ResourceError: if the file cannot be written.
        """
        lines: dict[str, str | int] = {"public": _z85_text(viewer.public).decode(), "name": viewer.name}
        lines |= {"role": viewer.role, "paired": viewer.paired or _date_of_today()}
        path = self.folder / "viewers" / f"{fingerprint(viewer.public)}.toml"
        _write_private(path, _toml_text(lines), overwrite=True)

    def add_edge(self, edge: PairedEdge) -> None:
        """Stores a paired edge. It replaces edges with the same address.

        Raises:
            ResourceError: if the file cannot be written.
        """
        # The address is part of the file's name, because an edge and a relay of one user have the same key.
        place = f"{edge.host.lower()}:{edge.control_port}"
        lines: dict[str, str | int] = {"public": _z85_text(edge.public).decode(), "name": edge.name}
        lines |= {"host": edge.host, "control_port": edge.control_port}
        lines |= {"role": edge.role, "paired": edge.paired or _date_of_today()}
        place_hash = hashlib.sha256(place.encode()).hexdigest()[:8]
        path = self.folder / "edges" / f"{fingerprint(edge.public)}.{place_hash}.toml"
        _write_private(path, _toml_text(lines), overwrite=True)
        for other, table in self._read_tables("edges", []):
            if other != path and f"{table.get('host')}:{table.get('control_port')}".lower() == place:
                self._delete_file(other)

    def forget(self, which: str) -> list[PairedViewer | PairedEdge]:
        """Removes the peers with the given name, address, or start of a fingerprint. Returns them.

        Raises:
            InputError: if no peer matches, or if several match.
        """
        peers: list[PairedViewer | PairedEdge] = [*self.load_viewers([]).values(), *self.load_edges([])]
        start = which.lower().replace("-", "")
        matches = [
            peer
            for peer in peers
            if which in (peer.name, getattr(peer, "host", ""))
            or (start and fingerprint(peer.public).replace("-", "").startswith(start))
        ]
        if len({peer.public for peer in matches}) != 1:
            problem = (
                "several paired viewers or edges match" if matches else "no paired viewer or edge matches"
            )
            raise InputError(
                problem, where=repr(which), remedy="Use a fingerprint from the output of: enliven keys list"
            )
        for peer in matches:
            self._remove("viewers" if isinstance(peer, PairedViewer) else "edges", peer.public)
        return matches

    def read_change_counter(self) -> int:
        """Returns a number that changes when a viewer is added or removed."""
        try:
            return (self.folder / "viewers").stat().st_mtime_ns
        except OSError:
            return 0

    def _remove(self, folder: str, public: bytes) -> None:
        for path in (self.folder / folder).glob(f"{fingerprint(public)}*.toml"):
            self._delete_file(path)

    def _delete_file(self, path: Path) -> None:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise file_fault(error, path, "written") from None

    def _read_tables(self, folder: str, problems: list[str] | None) -> list[tuple[Path, dict[str, Any]]]:
        """Returns the path and the content of each file in a folder."""
        tables = []
        for path in sorted((self.folder / folder).glob("*.toml"))[:_MAX_PEERS]:
            remedy = f"Remove the file: rm {path}. Then pair again."
            table = _read_checked(path, problems, lambda p=path, m=remedy: _read_private(p, m))
            if table is not None:
                tables.append((path, table))
        return tables


def _read_checked(path: Path, problems: list[str] | None, read: Any) -> Any:
    """Returns the result of ``read``. If ``read`` raises an error and ``problems`` is a list, the error is
    appended to it instead."""
    try:
        return read()
    except EnlivenError as error:
        if problems is None:
            raise
        problems.append(str(error))
        return None


def _viewer_from_table(table: dict[str, Any], path: Path) -> PairedViewer:
    public = _key_from_table(table, "public", path)
    return PairedViewer(
        public, _name_from_table(table, path), _role_from_table(table, path), str(table.get("paired", ""))
    )


def _edge_from_table(table: dict[str, Any], path: Path) -> PairedEdge:
    host, port = table.get("host"), table.get("control_port")
    if not isinstance(host, str) or not isinstance(port, int) or not 0 < port < 65536:
        raise _make_damaged_file_error(path, "the address is missing or invalid")
    peer = _viewer_from_table(table, path)
    return PairedEdge(peer.public, peer.name, host, port, peer.role, peer.paired)


def _name_from_table(table: dict[str, Any], path: Path) -> str:
    name = table.get("name")
    if not isinstance(name, str) or not 0 < len(name) <= _MAX_NAME_LENGTH:
        raise _make_damaged_file_error(path, "the name is missing or too long")
    return name


def _role_from_table(table: dict[str, Any], path: Path) -> Role:
    role = table.get("role")
    if role not in ROLES:
        raise _make_damaged_file_error(path, f"the role is {role!r:.40}, expected one of {', '.join(ROLES)}")
    return role


def _key_from_table(table: dict[str, Any], name: str, path: Path) -> bytes:
    """Returns the decoded key with a given name from the content of a file."""
    text = table.get(name)
    if isinstance(text, str) and len(text) == _Z85_KEY_LENGTH and text.isascii():
        with contextlib.suppress(KeyError, ValueError, struct.error):
            key = _from_z85(text.encode())
            if len(key) == KEY_BYTES:
                return key
    raise _make_damaged_file_error(path, f"the {name} key is missing or invalid")


def _make_damaged_file_error(path: Path, what: str) -> InputError:
    is_own = path.name == "own.toml"
    return InputError(
        f"this is not a key file, or it is damaged ({what})",
        where=str(path),
        remedy=_NEW_KEYS_ADVICE if is_own else f"Remove the file: rm {path}. Then pair again.",
    )


def _read_private(path: Path, remedy: str) -> dict[str, Any] | None:
    """Returns the content of a file that only this user may read, or None if it does not exist.

    Raises:
        InputError: if it is not a TOML file, belongs to another user, or can be read or changed by other
            users.
    """
    try:
        state = path.lstat()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise file_fault(error, path) from None
    if not stat.S_ISREG(state.st_mode):
        raise InputError("the key file is not a regular file", where=str(path), remedy=remedy)
    if sys.platform != "win32":
        if state.st_uid != os.getuid():
            raise InputError("the key file belongs to another user", where=str(path), remedy=remedy)
        if state.st_mode & _OTHER_USERS_MODE_MASK:
            raise InputError(
                f"other users may read or change this key file (mode {stat.S_IMODE(state.st_mode):04o})",
                where=str(path),
                remedy=f"If no other user has read the file: chmod 600 {path}. "
                f"Otherwise other users may know the key. {remedy}",
            )
    try:
        return read_toml(path)
    except InputError as error:
        raise type(error)(error.what, where=str(path), remedy=error.remedy or remedy) from None


def _write_private(path: Path, text: str, *, overwrite: bool) -> None:
    """Writes a file that only this user may read, completely or not at all.

    Raises:
        InputError: if the file exists and ``overwrite`` is not set.
        ResourceError: if it cannot be written.
    """
    part = path.with_name(f".{path.name}.{secrets.token_hex(8)}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        # The file is created with its final mode, so that it is private from its first byte.
        descriptor = os.open(part, _NEW_FILE_FLAGS, 0o600)
        try:
            with os.fdopen(descriptor, "w", encoding="utf-8", newline="\n") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            if overwrite:
                os.replace(part, path)
            else:
                # Create a hard link, because this fails if the name exists. A rename would replace a file
                # that another process has created in the meantime.
                os.link(part, path)
        finally:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
    except FileExistsError:
        raise InputError(
            "this computer already has keys",
            where=str(path),
            remedy="The keys stay unchanged. To replace the keys: enliven keys make --overwrite. All "
            "paired viewers and edges "
            "must then pair again.",
        ) from None
    except OSError as error:
        raise file_fault(error, path, "written") from None


def _toml_text(lines: dict[str, str | int]) -> str:
    """Returns the text of a TOML file with its version and one line for each value."""
    value_lines = [f"{key} = {_toml_value(value)}" for key, value in lines.items()]
    return "\n".join(["version = 1", *value_lines, ""])


def _toml_value(value: str | int) -> str:
    if isinstance(value, int):
        return str(value)
    escapes = {'"': '\\"', "\\": "\\\\"}
    text = "".join(escapes.get(c, c if c.isprintable() else "?") for c in value)
    return f'"{text}"'


def clean_name(name: str) -> str:
    """Returns a peer's name without unprintable characters, at most 64 characters and never empty."""
    return re.sub(r"\s+", " ", "".join(c for c in name if c.isprintable())).strip()[:_MAX_NAME_LENGTH] or "?"


def _date_of_today() -> str:
    return time.strftime("%Y-%m-%d")


def _z85_text(key: bytes) -> bytes:
    from zmq.utils import z85

    return z85.encode(key)


def _from_z85(text: bytes) -> bytes:
    from zmq.utils import z85

    return z85.decode(text)
