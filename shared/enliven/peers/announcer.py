"""Announces an edge or a relay on the local network by DNS-SD (Zeroconf), in the background."""

from __future__ import annotations

import contextlib
import ipaddress
import itertools
import logging
import socket
import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from enliven.peers.announcement import SERVICE_TYPE, Announcement, pack_announcement

log = logging.getLogger(__name__)

_MIN_UPDATE_INTERVAL_S = 1.0
"""Minimum interval in seconds between two changes of the announcement. It is limited, because every computer
on the network receives them."""
_NAME_TIMEOUT_MS = 2500
"""Timeout in milliseconds of the question whether another service has the name. A service that was announced
less than a second ago replies after more than a second."""
_CLOSE_TIMEOUT_S = 3.0
"""Timeout in seconds for withdrawing the announcement (the goodbye message)."""


class Announcer:
    """Announces a service from its construction until :meth:`close`, on its own thread.

    A failure is only logged. Users must then enter the address in viewers.

    Args:
        announcement: the announcement of the service.
        host: the address that the service listens on. "0.0.0.0", "::", "*" or "" mean all addresses.
    """

    def __init__(self, announcement: Announcement, host: str) -> None:
        self._announcement, self._host = announcement, host
        self._changed, self._closed = threading.Event(), threading.Event()
        self.name = ""
        """Name of the service on the network after it was announced. "-2" is appended if another service has
        the same name.
        """
        self._thread = threading.Thread(target=self._run, name="announcer", daemon=True)
        self._thread.start()

    def set_characters(self, count: int) -> None:
        """Changes the announced number of characters. Does not block."""
        if count != self._announcement.characters:
            self._announcement = replace(self._announcement, characters=count)
            self._changed.set()

    def close(self) -> None:
        """Withdraws the announcement, so that viewers are informed immediately."""
        self._closed.set()
        self._changed.set()
        self._thread.join(_CLOSE_TIMEOUT_S)

    def __enter__(self) -> Announcer:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _run(self) -> None:
        try:
            self._announce()
        except Exception as error:
            # The network may be down, or another program may own the port of multicast DNS.
            log.warning("the edge %s cannot be announced on the network: %s", self._announcement.name, error)

    def _announce(self) -> None:
        from zeroconf import InterfaceChoice, Zeroconf

        addresses = list_own_addresses(self._host)
        if not addresses:
            log.warning(
                "the edge %s is not announced, because this computer has no network connection",
                self._announcement.name,
            )
            return
        everywhere = self._host in _ALL_ADDRESSES
        zeroconf = Zeroconf(interfaces=InterfaceChoice.All if everywhere else addresses)
        try:
            announced = self._announcement
            info = _service_info(announced, _find_free_name(zeroconf, announced.instance), addresses)
            zeroconf.register_service(info, allow_name_change=True)
            self.name = info.name.removesuffix("." + SERVICE_TYPE)
            log.info("the edge is announced on the network as %s", self.name)
            while not self._closed.is_set():
                self._changed.wait()
                self._changed.clear()
                if not self._closed.is_set() and self._announcement != announced:
                    announced = self._announcement
                    zeroconf.update_service(_service_info(announced, self.name, addresses))
                    self._closed.wait(_MIN_UPDATE_INTERVAL_S)
        finally:
            with contextlib.suppress(Exception):
                zeroconf.close()  # This also sends the goodbye message.


def _find_free_name(zeroconf: Any, instance: str) -> str:
    """Returns a name that no service on the network has: the instance, or with "-2", "-3", ... appended.

    The library's own check asks for replies to this address and port. If several programs of a computer share
    the port of multicast DNS, the system gives such a reply to any of them. So ask for a reply to everyone.
    """
    from zeroconf import DNSQuestionType

    def is_free(name: str) -> bool:
        full_name, question = f"{name}.{SERVICE_TYPE}", DNSQuestionType.QM
        return zeroconf.get_service_info(SERVICE_TYPE, full_name, _NAME_TIMEOUT_MS, question) is None

    names = itertools.chain([instance], (f"{instance}-{number}" for number in itertools.count(2)))
    return next(filter(is_free, names))


_ALL_ADDRESSES = ("0.0.0.0", "::", "*", "")
"""Addresses that mean all network interfaces."""


def list_own_addresses(host: str) -> list[str]:
    """Returns the addresses of this machine at which other machines can reach a service that listens on
    ``host``."""
    if host in _ALL_ADDRESSES:
        import ifaddr

        ips = [ip.ip for adapter in ifaddr.get_adapters() for ip in adapter.ips]
        texts = [
            ip if isinstance(ip, str) else ip[0] for ip in ips if host != "0.0.0.0" or isinstance(ip, str)
        ]
        return [text for text in dict.fromkeys(texts) if not _is_near(text)]
    with contextlib.suppress(OSError, UnicodeError):
        return list(dict.fromkeys(str(info[4][0]) for info in socket.getaddrinfo(host, None)))
    return []


def _is_near(text: str) -> bool:
    """Returns True if other machines cannot use an address. This is so for loopback, and for link-local IPv6
    addresses, which require the name of an interface.
    """
    address = ipaddress.ip_address(text.partition("%")[0])
    return address.is_loopback or (address.version == 6 and address.is_link_local)


def _service_info(announcement: Announcement, instance: str, addresses: Sequence[str]) -> Any:
    from zeroconf import ServiceInfo

    return ServiceInfo(
        SERVICE_TYPE,
        f"{instance}.{SERVICE_TYPE}",
        port=announcement.pose_port,
        properties=pack_announcement(announcement),
        parsed_addresses=list(addresses),
        server=f"{socket.gethostname().partition('.')[0] or 'enliven'}-{announcement.pose_port}.local.",
    )
