"""Finds the edges and relays that announce themselves on the local network."""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

from enliven.errors import EnlivenError, InputError, ResourceError
from enliven.keys.key_files import KeyStore
from enliven.peers.announcement import (
    SERVICE_TYPE,
    Announcement,
    find_missing_discovery_reason,
    parse_announcement,
)
from enliven.wire import Endpoint

log = logging.getLogger(__name__)

MAX_FOUND_EDGES = 64
"""Maximum number of listed edges. It is limited, because a malicious program could announce thousands of
edges."""
_MAX_ADDRESSES = 8
"""Maximum number of addresses of one edge that are tried."""
_RESOLVE_TIMEOUT_MS = 2000
"""Timeout of a query for the details of an announced edge, in milliseconds."""
_CHECK_INTERVAL_S = 5.0
"""Interval in seconds between two checks that an edge answers. They are needed because a crashed edge stays
announced for two minutes."""
_CONNECT_TIMEOUT_S = 0.7
"""Timeout of a connection to an edge on the local network, in seconds."""

_ENDING = f".{SERVICE_TYPE}"
"""Last part of the name of every service of this type."""


@dataclass(frozen=True)
class DiscoveredEdge:
    """An edge on the network.

    Attributes:
        service: the edge's unique name on the network.
        announcement: the edge's announcement. Names in it are escaped for display.
        addresses: its addresses, IPv4 first.
        host: the address that answered. Empty if none has answered yet.
        is_paired: True if this machine has a key of the edge, or the edge works without keys.
    """

    service: str
    announcement: Announcement
    addresses: tuple[str, ...]
    host: str = ""
    is_paired: bool = False

    @property
    def endpoint(self) -> Endpoint:
        """The edge's address for a viewer: the address that answered, or else the first address."""
        host = self.host or self.addresses[0]
        return Endpoint(host, self.announcement.pose_port, self.announcement.control_port)

    @property
    def problem(self) -> str:
        """The reason why a viewer on this machine cannot connect. Empty if it can."""
        if self.announcement.problem:
            return self.announcement.problem
        if not self.host:
            return "does not answer"
        return "" if self.is_paired else "is not paired with this computer"

    @property
    def is_usable(self) -> bool:
        """True if a viewer can connect."""
        return not self.problem


class EdgeBrowser:
    """A list of the edges on the network, which changes in the background until :meth:`close`.

    Args:
        interfaces: addresses of this machine's network interfaces to search on. None means all.

    Raises:
        ResourceError: if the required library is missing, or the network does not allow the search.
    """

    def __init__(self, interfaces: list[str] | None = None) -> None:
        problem, _, remedy = find_missing_discovery_reason().partition(". ")
        if problem:
            raise ResourceError(problem, where="search for edges", remedy=f"{remedy}.")
        from zeroconf import InterfaceChoice, ServiceBrowser, Zeroconf

        self._lock = threading.Lock()
        self._edges: dict[str, DiscoveredEdge] = {}
        self._closed = threading.Event()
        self._check_now = threading.Event()
        self._interfaces = interfaces
        try:
            self._zeroconf = Zeroconf(interfaces=InterfaceChoice.All if interfaces is None else interfaces)
            self._browser = ServiceBrowser(self._zeroconf, SERVICE_TYPE, listener=_Listener(self))
        except (OSError, ValueError) as error:
            raise ResourceError(
                f"the network cannot be searched for edges ({error})",
                where="search for edges",
                remedy="Pass the address of the edge with --edge.",
            ) from None
        self._checker = threading.Thread(target=self._check_until_closed, name="edge browser", daemon=True)
        self._checker.start()

    @property
    def edges(self) -> tuple[DiscoveredEdge, ...]:
        """The edges, sorted by displayed name, then by name on the network."""
        with self._lock:
            edges = list(self._edges.values())
        return tuple(sorted(edges, key=lambda e: (e.announcement.name, e.service.removesuffix(_ENDING))))

    def close(self) -> None:
        """Ends the search."""
        self._closed.set()
        self._check_now.set()
        with contextlib.suppress(Exception):
            self._zeroconf.close()
        self._checker.join(2.0)

    def resolve(self, zeroconf: Any, service: str) -> None:
        """Adds or changes an edge that was announced. Ignores it if its announcement cannot be read."""
        info = zeroconf.get_service_info(SERVICE_TYPE, service, timeout=_RESOLVE_TIMEOUT_MS)
        if info is None:
            return
        try:
            announcement = parse_announcement(info.port, info.properties)
        except InputError as error:
            log.debug("the announcement %r is ignored: %s", service, error)
            return
        texts = [address for address in info.parsed_scoped_addresses() if is_on_local_network(address)]
        addresses = tuple(sorted(texts, key=lambda a: ":" in a))[:_MAX_ADDRESSES]
        if not addresses:
            return
        with self._lock:
            listed_edge = self._edges.get(service)
            if listed_edge is None and len(self._edges) >= MAX_FOUND_EDGES:
                log.debug("more than %d edges are announced", MAX_FOUND_EDGES)
                return
            host = listed_edge.host if listed_edge is not None and listed_edge.host in addresses else ""
            self._edges[service] = DiscoveredEdge(service, announcement, addresses, host)
        self._check_now.set()

    def forget(self, service: str) -> None:
        """Removes an edge that is no longer announced."""
        with self._lock:
            self._edges.pop(service, None)

    def _check_until_closed(self) -> None:
        with ThreadPoolExecutor(8, "edge check") as pool:
            while not self._closed.is_set():
                self._check_now.clear()
                for checked in pool.map(check_edge, self.edges):
                    with self._lock:
                        listed_edge = self._edges.get(checked.service)
                        if listed_edge is not None:
                            self._edges[checked.service] = replace(
                                listed_edge, host=checked.host, is_paired=checked.is_paired
                            )
                self._check_now.wait(_CHECK_INTERVAL_S)


class _Listener:
    """A listener that passes zeroconf's events to a browser. It runs on zeroconf's thread."""

    def __init__(self, browser: EdgeBrowser) -> None:
        self._browser = browser

    def add_service(self, zeroconf: Any, kind: str, name: str) -> None:
        """Handles a new service."""
        self._browser.resolve(zeroconf, name)

    def update_service(self, zeroconf: Any, kind: str, name: str) -> None:
        """Handles a changed service."""
        self._browser.resolve(zeroconf, name)

    def remove_service(self, zeroconf: Any, kind: str, name: str) -> None:
        """Handles a removed service."""
        self._browser.forget(name)


def check_edge(edge: DiscoveredEdge) -> DiscoveredEdge:
    """Returns the edge with ``host`` and ``is_paired`` updated. Blocks for a short time."""
    port = edge.announcement.pose_port
    order = dict.fromkeys(([edge.host] if edge.host else []) + list(edge.addresses))
    host = next((address for address in order if _accepts_connections(address, port)), "")
    return replace(edge, host=host, is_paired=_is_paired(edge, host))


def find_edges(seconds: float, interfaces: list[str] | None = None) -> tuple[DiscoveredEdge, ...]:
    """Searches for edges for some seconds, and returns them. Raises the errors of :class:`EdgeBrowser`."""
    browser = EdgeBrowser(interfaces)
    try:
        time.sleep(seconds)
        edges = browser.edges
    finally:
        browser.close()
    return tuple(check_edge(edge) for edge in edges)


def describe_edge(edge: DiscoveredEdge) -> tuple[str, str]:
    """Returns one line of text about an edge on the network, and the remedy for its problem, or an empty
    string without a problem.
    """
    announced, address = edge.announcement, edge.endpoint
    plural = "s" * (announced.characters != 1)
    kind = (
        f"relay of {announced.relay_of}"
        if announced.relay_of
        else f"{announced.characters} character{plural}"
    )
    lock = ("paired" if edge.is_paired else "needs pairing") if announced.has_keys else "no keys"
    line = f"{address}, {kind}, {lock}, enliven {announced.version or '?'}"
    if not edge.problem:
        return line, ""
    if announced.problem:
        remedy = "Install the same release of enliven on both computers."
    elif not edge.host:
        remedy = "Check that the edge runs, and check the firewall of its computer."
    else:
        remedy = f"Pair this computer with the edge: enliven pair {address} CODE. The edge shows the code."
    return f"{line}: {edge.problem}", remedy


def is_on_local_network(text: str) -> bool:
    """Returns True if an address is private, or in one of this machine's networks.

    Any program can announce any address. So only local addresses are contacted, and no addresses on the
    internet.
    """
    import ifaddr

    address = ipaddress.ip_address(text.partition("%")[0])
    if address.is_private or address.is_link_local or address.is_loopback:
        return True
    for adapter in ifaddr.get_adapters():
        for own_address in adapter.ips:
            host = own_address.ip if isinstance(own_address.ip, str) else own_address.ip[0]
            network = ipaddress.ip_network(f"{host}/{own_address.network_prefix}", strict=False)
            if network.version == address.version and address in network and network.prefixlen > 0:
                return True
    return False


def answers_locally(endpoint: Endpoint) -> bool:
    """Returns True if a program listens at an address of this machine."""
    return _accepts_connections(endpoint.host, endpoint.pose_port)


def _accepts_connections(host: str, port: int) -> bool:
    try:
        with socket.create_connection((host, port), _CONNECT_TIMEOUT_S):
            return True
    except (OSError, UnicodeError):
        return False


def _is_paired(edge: DiscoveredEdge, host: str) -> bool:
    """Returns True if this machine has a key for the edge, or the edge works without keys."""
    if not edge.announcement.has_keys:
        return True
    store = KeyStore()
    try:
        return store.server_key(host or edge.addresses[0], edge.announcement.control_port) is not None
    except EnlivenError as error:
        log.debug("the keys of this computer cannot be read: %s", error)
        return False
