"""Reads, checks and loads the TLS certificate of a web server."""

from __future__ import annotations

import ssl
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from enliven.errors import InputError
from enliven.files import read_file
from enliven.web_server.access import read_secret_file

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

_MAX_PEM_BYTES = 1 << 20
"""Maximum size in bytes of a file with certificates or a key. A certificate chain has about 10,000 bytes."""
_NEW_CERTIFICATE_ADVICE = "docs/health.md shows how to create a new certificate."
"""The remedy for an invalid certificate."""


@dataclass(frozen=True)
class ServerCertificate:
    """A TLS certificate with its key, ready for a server.

    Attributes:
        path: file of the certificate.
        end_s: Unix time at which it expires, in seconds.
        context: the SSL context for a server's sockets.
    """

    path: Path
    end_s: float
    context: ssl.SSLContext


def load_certificate(path: Path, key: Path, at_s: float) -> ServerCertificate:
    """Loads a certificate, and checks that it is currently valid.

    Args:
        path: file with the certificate, followed by those of its issuers if there are any (PEM).
        key: file with its private key (PEM), without a passphrase.
        at_s: Unix time in seconds.

    Raises:
        InputError: if a file cannot be read, the certificate is not valid now, the key does not match or has
            a passphrase, or the key is readable by other users.
    """
    certificate = _read_certificate(path)
    read_secret_file(key, "key file", _MAX_PEM_BYTES)
    valid_from, end = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    if at_s >= end.timestamp():
        raise InputError(
            f"the certificate expired on {_format_date(end)}", where=str(path), remedy=_NEW_CERTIFICATE_ADVICE
        )
    if at_s < valid_from.timestamp():
        raise InputError(
            f"the certificate is not valid before {_format_date(valid_from)}",
            where=str(path),
            remedy="Check the clock. The time of this computer is "
            f"{_format_date(datetime.fromtimestamp(at_s, tz=UTC))}.",
        )
    return ServerCertificate(path, end.timestamp(), _load_context(path, key))


def read_end(path: Path) -> float:
    """Returns the Unix time in seconds at which a certificate expires.

    Raises:
        InputError: if the file cannot be read or does not contain a certificate.
    """
    return _read_certificate(path).not_valid_after_utc.timestamp()


def _read_certificate(path: Path) -> Certificate:
    """Returns the first certificate of a file (PEM). Raises the errors of :func:`read_end`."""
    from cryptography import x509

    pem = read_file(path, _MAX_PEM_BYTES)
    try:
        return x509.load_pem_x509_certificate(pem)
    except ValueError:
        raise InputError(
            "the file does not contain a certificate (PEM)", where=str(path), remedy=_NEW_CERTIFICATE_ADVICE
        ) from None


def _load_context(path: Path, key: Path) -> ssl.SSLContext:
    """Returns a server's SSL context with a certificate and its key. Raises the errors of
    :func:`load_certificate`.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    has_passphrase = False

    def refuse_passphrase() -> str:
        nonlocal has_passphrase
        has_passphrase = True
        return ""

    try:
        context.load_cert_chain(path, key, password=refuse_passphrase)
    except (ssl.SSLError, ValueError, OSError) as error:
        if has_passphrase:
            problem, remedy = (
                "the key has a passphrase",
                f"Remove the passphrase: openssl pkey -in {key} -out NEW_KEY",
            )
        elif getattr(error, "reason", "") == "KEY_VALUES_MISMATCH":
            problem, remedy = f"the key does not belong to the certificate {path}", _NEW_CERTIFICATE_ADVICE
        else:
            problem, remedy = "the file does not contain a private key (PEM)", _NEW_CERTIFICATE_ADVICE
        raise InputError(problem, where=str(key), remedy=remedy) from None
    return context


def _format_date(moment: datetime) -> str:
    """Returns a text with the date and time of a moment."""
    return moment.strftime("%Y-%m-%d %H:%M UTC")
