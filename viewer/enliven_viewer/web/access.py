"""Determines which people may open the page: users of this machine, users that know the
address, or everyone.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from enliven.errors import InputError
from enliven.files import user_data_folder
from enliven.keys.key_files import is_loopback
from enliven.web_server.access import is_same_origin, names_this_computer, read_own_token, tokens_match
from enliven.web_server.certificate import load_certificate
from enliven.web_server.listening import format_address

_TOKEN_FILE = "web-token"
_HOW_TO_OPEN = (
    "Pass --certificate and --certificate-key (TLS), or --insecure if everyone on the network may watch."
)


@dataclass(frozen=True)
class WebAccess:
    """The address of the page, and the rules for requests.

    Attributes:
        host: network address to listen on.
        token: secret text that the page's address must contain; empty if no token is needed.
        certificate, key: files of TLS (PEM). None for plain HTTP.
    """

    host: str
    token: str = ""
    certificate: Path | None = None
    key: Path | None = None

    @property
    def is_local(self) -> bool:
        """Returns True if only this machine can open the page."""
        return is_loopback(self.host)

    def address(self, port: int) -> str:
        """Returns the address of the page without the token."""
        return format_address(self.host, port, uses_tls=self.certificate is not None)

    def link(self, port: int) -> str:
        """Returns the complete address of the page. The token is after the #, because browsers do not send
        this part to servers.
        """
        return self.address(port) + (f"#token={self.token}" if self.token else "")

    def admits(self, token: str, host: str, origin: str) -> bool:
        """Returns True if a browser may get the stream.

        Args:
            token: the token of the request.
            host, origin: the headers "Host" and "Origin" of the request.
        """
        if not is_same_origin(host, origin):
            return False  # Another web site must not read the stream through a visitor's browser.
        if self.is_local and not names_this_computer(host):
            return False
        return tokens_match(token, self.token)


def load_access(
    host: str, insecure: bool = False, certificate: Path | None = None, key: Path | None = None
) -> WebAccess:
    """Returns the access rules for an address to listen on.

    Raises:
        InputError: if other machines could watch without encryption, and ``insecure`` is not set; or if the
            certificate cannot be used.
    """
    if (certificate is None) != (key is None):
        raise InputError(
            "TLS needs a certificate and its key",
            where="enliven web",
            remedy="Pass both --certificate and --certificate-key.",
        )
    if certificate is not None and key is not None:
        load_certificate(certificate, key, time.time())
        return WebAccess(host, "" if is_loopback(host) else read_token(user_data_folder()), certificate, key)
    if not is_loopback(host) and not insecure:
        raise InputError(
            "this address is open to other machines, but the connection is not encrypted",
            where=f"--host {host}",
            remedy=_HOW_TO_OPEN,
        )
    return WebAccess(host)


def read_token(folder: Path) -> str:
    """Returns this user's token, which is stored in a folder. The first call creates it. The token never
    changes, so that open pages can reconnect.

    Raises:
        ResourceError: if its file cannot be read or written.
    """
    return read_own_token(folder / _TOKEN_FILE)
