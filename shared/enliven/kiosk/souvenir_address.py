"""Checks the address of souvenirs in the profile, and determines the address for QR codes."""

from __future__ import annotations

from urllib.parse import urlsplit

from enliven.errors import InputError
from enliven.keys.key_files import is_loopback
from enliven.web_server.listening import format_address

from .profile import SouvenirSettings

_MAX_ADDRESS_LENGTH = 100
"""Maximum length of the start of an address. With a longer address, phones cannot read the QR code from 2
m."""
_ADDRESS_ADVICE = (
    "Write an address like http://kiosk.example:5592/, without a question mark, a hash or a password."
)
"""The remedy for an invalid address."""
_REACHABILITY_ADVICE = (
    'Set souvenir.host = "0.0.0.0". If phones reach this computer by another address, '
    "also set souvenir.address."
)
"""The remedy for an address that no phone can open."""


def check_souvenir_address(settings: SouvenirSettings, where: str) -> None:
    """Raises InputError if phones cannot open the address of souvenirs. Does nothing if souvenirs are
    disabled.

    Args:
        where: path of the profile, for the message.
    """
    if not settings.kind:
        return
    if bool(settings.certificate) != bool(settings.certificate_key):
        raise InputError(
            "only one of souvenir.certificate and souvenir.certificate_key is set",
            where=where,
            remedy="Set both files, or neither.",
        )
    if settings.certificate and settings.address.startswith("http://"):
        raise InputError(
            f"souvenir.address {settings.address[:_MAX_ADDRESS_LENGTH]} starts with http://, but "
            "the server uses TLS",
            where=where,
            remedy="Write https:// at the start of the address.",
        )
    if not settings.address:
        if is_loopback(settings.host):
            raise InputError(
                f"phones cannot reach souvenir.host = {settings.host}, because only this computer can "
                "use this address",
                where=where,
                remedy=_REACHABILITY_ADVICE,
            )
        return
    name = _host_of(settings.address)
    if not name:
        raise InputError(
            f"souvenir.address {settings.address[:_MAX_ADDRESS_LENGTH]!r} is not a valid start of an address",
            where=where,
            remedy=_ADDRESS_ADVICE,
        )
    if is_loopback(name):
        problem = (
            f"phones cannot reach souvenir.address = {settings.address}, because only this "
            "computer can use this address"
        )
        raise InputError(problem, where=where, remedy="Write the network address of this computer.")


def find_souvenir_address(settings: SouvenirSettings) -> str:
    """Returns the start of the address of souvenirs, or an empty string if this computer is not in a
    network."""
    if settings.address:
        return settings.address.rstrip("/") + "/"
    address = format_address(settings.host, settings.port, uses_tls=bool(settings.certificate))
    return "" if is_loopback(_host_of(address)) else address


def _host_of(address: str) -> str:
    """Returns the host name in the start of an address, or an empty string if the address is invalid."""
    if (
        len(address) > _MAX_ADDRESS_LENGTH
        or not address.isascii()
        or not address.isprintable()
        or " " in address
    ):
        return ""
    try:
        parts = urlsplit(address)
        has_port = parts.port is None or parts.port > 0
    except ValueError:
        return ""
    is_plain = not (parts.query or parts.fragment or "@" in parts.netloc or "?" in address or "#" in address)
    return (parts.hostname or "") if parts.scheme in ("http", "https") and is_plain and has_port else ""
