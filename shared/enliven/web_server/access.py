"""Access control of web pages: passwords with a rate limit, secret tokens, and protection against other web
pages."""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import ipaddress
import os
import re
import secrets
import stat
import sys
import time
from collections import OrderedDict
from pathlib import Path

from enliven.errors import InputError
from enliven.files import file_fault
from enliven.keys.key_files import is_loopback

PASSWORD_VARIABLE = "ENLIVEN_HEALTH_PASSWORD"
"""Environment variable with the password, for programs that read the health page of another computer."""
MIN_PASSWORD_LENGTH = 10
"""Minimum length of the password. With the rate limit, a random password of this length cannot be guessed."""
MAX_FAILURES = 5
"""Number of wrong passwords from one address after which the address is locked."""
LOCKOUT_S = 60.0
"""Time in seconds for which an address is locked. After that, each wrong password locks it again."""
_MAX_ADDRESSES = 1000
"""Maximum number of stored addresses that sent wrong passwords."""
_MAX_PASSWORD_BYTES = 4096
"""Maximum size of a password file in bytes."""
_OTHER_USERS_MODE_MASK = stat.S_IRWXG | stat.S_IRWXO
"""Permission bits of users other than the owner."""
_IPV6_PREFIX = 64
"""Number of bits in the network prefix of an IPv6 address. A computer can choose the remaining bits
itself."""
_TOKEN_BYTES = 16
"""Number of random bytes of a token in a URL. A token of this length cannot be guessed."""
_TOKEN_PATTERN = re.compile(r"[A-Za-z0-9_-]{22}")
"""Pattern of a token: 16 bytes in URL-safe base64."""


def read_secret_file(path: Path, content: str, max_bytes: int) -> bytes:
    """Returns the content of a file that only its owner may read.

    Args:
        content: the kind of file for messages, such as "password file".
        max_bytes: maximum size of the file in bytes.

    Raises:
        InputError: if it cannot be read, is too large, belongs to another user, or is readable by other
            users.
    """
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)
    try:
        descriptor = os.open(path, flags)
    except (OSError, ValueError) as error:
        if isinstance(error, OSError):
            raise file_fault(error, path) from None
        raise InputError("this file name is not valid", where=str(path)) from None
    try:
        state = os.fstat(descriptor)
        if not stat.S_ISREG(state.st_mode):
            raise InputError(
                "this is not a regular file", where=str(path), remedy=f"Set the path of the {content}."
            )
        if sys.platform != "win32":
            _refuse_other_users(path, content, state)
        with os.fdopen(os.dup(descriptor), "rb") as file:
            data = file.read(max_bytes + 1)
    finally:
        os.close(descriptor)
    if len(data) > max_bytes:
        raise InputError(
            f"the file has more than {max_bytes} bytes",
            where=str(path),
            remedy=f"Set the path of the {content}.",
        )
    return data


def _refuse_other_users(path: Path, content: str, state: os.stat_result) -> None:
    """Raises InputError if a file belongs to another user, or other users may read or change it."""
    if state.st_uid not in (os.getuid(), 0):
        raise InputError(
            "the file belongs to another user", where=str(path), remedy=f"Create your own {content}."
        )
    if state.st_mode & _OTHER_USERS_MODE_MASK:
        raise InputError(
            f"other users may read or change this {content} (mode {stat.S_IMODE(state.st_mode):04o})",
            where=str(path),
            remedy=f"Run: chmod 600 {path}",
        )


def read_password(path: Path) -> str:
    """Returns the password in the first line of a file.

    Raises:
        InputError: in the cases of :func:`read_secret_file`, or if the password is too short.
    """
    data = read_secret_file(path, "password file", _MAX_PASSWORD_BYTES)
    try:
        password = (data.decode().splitlines() or [""])[0].strip()
    except UnicodeDecodeError:
        raise InputError(
            "the password is not UTF-8 text", where=str(path), remedy="Write the password again."
        ) from None
    if len(password) < MIN_PASSWORD_LENGTH:
        raise InputError(
            f"the password has {len(password)} characters, but needs at least {MIN_PASSWORD_LENGTH}",
            where=str(path),
            remedy="Write a longer password into the first line of the file.",
        )
    return password


class PasswordGate:
    """Checks passwords of HTTP basic authentication, with a rate limit per address.

    Args:
        password: the password. The user name is ignored.
    """

    def __init__(self, password: str) -> None:
        self._digest = _hash_password(password.encode())
        self._failures: OrderedDict[str, tuple[int, float]] = OrderedDict()

    def compute_remaining_lockout_s(self, address: str) -> float:
        """Returns the remaining seconds for which an address is locked, or 0 if it is not locked."""
        count, last_s = self._failures.get(_address_network(address), (0, 0.0))
        if count < MAX_FAILURES:
            return 0.0
        return max(0.0, last_s + LOCKOUT_S - time.monotonic())

    def admits(self, address: str, authorization: str) -> bool:
        """Checks the "Authorization" header of a request. A wrong password counts as a failure.

        Returns:
            True if the password is correct and the address is not locked. A correct password is refused
            during the lock, so that a guess cannot be confirmed.
        """
        if self.compute_remaining_lockout_s(address) > 0.0:
            return False
        password = _basic_password(authorization)
        if password is not None and hmac.compare_digest(_hash_password(password), self._digest):
            self._failures.pop(_address_network(address), None)
            return True
        if authorization:
            self._count_failure(_address_network(address))
        return False

    def _count_failure(self, network: str) -> None:
        """Counts a wrong password of an address. Drops the oldest addresses if there are too many."""
        count, _ = self._failures.pop(network, (0, 0.0))
        self._failures[network] = (count + 1, time.monotonic())
        while len(self._failures) > _MAX_ADDRESSES:
            self._failures.popitem(last=False)


class FormTokens:
    """Tokens in forms, which other web pages cannot know (CSRF protection).

    A token is valid for one action on one subject, until the program ends.
    """

    def __init__(self) -> None:
        self._secret = secrets.token_bytes(32)

    def make(self, action: str, subject: str) -> str:
        """Returns the token of a form for an action on a subject."""
        message = f"{action}\0{subject}".encode(errors="replace")
        return hmac.new(self._secret, message, hashlib.sha256).hexdigest()

    def check(self, action: str, subject: str, token: str) -> bool:
        """Returns True if a token is valid for an action on a subject."""
        return hmac.compare_digest(self.make(action, subject).encode(), token.encode(errors="replace"))


def is_same_origin(host: str, origin: str, fetch_site: str = "") -> bool:
    """Returns True if a browser sent a request from a page of this server.

    Args:
        host: the "Host" header of the request.
        origin: the "Origin" header. Empty if there is none, as in requests from scripts.
        fetch_site: the "Sec-Fetch-Site" header. Empty if there is none.
    """
    if fetch_site and fetch_site not in ("same-origin", "none"):
        return False
    return not origin or origin.partition("://")[2].lower() == host.lower()


def names_this_computer(host: str) -> bool:
    """Returns True if the "Host" header of a request names the loopback of this computer.

    A server on loopback refuses all other requests. Otherwise a malicious web page could let its own domain
    name point to this computer, and read from the server (DNS rebinding).
    """
    name = host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]
    return is_loopback(name)


def make_token() -> str:
    """Returns a new random token for a URL. It cannot be guessed."""
    return secrets.token_urlsafe(_TOKEN_BYTES)


def is_token(text: str) -> bool:
    """Returns True if a text has the form of a token."""
    return _TOKEN_PATTERN.fullmatch(text) is not None


def tokens_match(given: str, token: str) -> bool:
    """Returns True if two tokens are equal. The comparison takes constant time, so that its duration does not
    reveal the token.
    """
    return hmac.compare_digest(given.encode(errors="replace"), token.encode())


def read_own_token(path: Path) -> str:
    """Returns the token in a file of this user. The first call creates it, later calls return the same token.

    Raises:
        ResourceError: if the file cannot be read or written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        # The file is created with its final mode, so that it is private from its first byte.
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        with os.fdopen(descriptor, "r+", encoding="ascii", errors="replace") as file:
            token = file.read(200).strip()
            if not is_token(token):
                token = make_token()
                file.seek(0)
                file.truncate()
                file.write(token + "\n")
    except OSError as error:
        raise file_fault(error, path, "written") from None
    return token


def _hash_password(password: bytes) -> bytes:
    """Returns a digest of fixed length, so that a comparison does not reveal the length of the password."""
    return hashlib.sha256(password).digest()


def _basic_password(authorization: str) -> bytes | None:
    """Returns the password in an "Authorization" header, or None if it contains none."""
    scheme, _, encoded_password = authorization.partition(" ")
    if scheme.lower() != "basic":
        return None
    try:
        user, separator, password = base64.b64decode(encoded_password.strip(), validate=True).partition(b":")
    except (binascii.Error, ValueError):
        return None
    del user
    return password if separator else None


def _address_network(address: str) -> str:
    """Returns the part of an IP address that a computer cannot choose itself: the network prefix for IPv6."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if parsed.version == 4:
        return str(parsed)
    ipv4_address = parsed.ipv4_mapped
    if ipv4_address is not None:
        return str(ipv4_address)
    return str(ipaddress.ip_network((parsed, _IPV6_PREFIX), strict=False))
