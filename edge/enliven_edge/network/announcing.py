"""Announces an edge or a relay on the local network, if other machines reach it."""

from __future__ import annotations

import logging

from enliven.peers.announcement import Announcement, find_missing_discovery_reason
from enliven.peers.announcer import Announcer
from enliven.wire import Endpoint
from enliven_edge.network.tcp_listener import is_local
from enliven_edge.settings import WireSettings

log = logging.getLogger(__name__)


def announce(
    wire: WireSettings, endpoint: Endpoint, *, has_keys: bool, characters: int = 0, relay_of: str = ""
) -> Announcer | None:
    """Returns an announcer.

    Returns None if only this machine reaches the edge, or if discovery is not installed.
    """
    if not wire.announce or is_local(wire.host):
        return None
    problem = find_missing_discovery_reason()
    if problem:
        log.info("viewers cannot find this edge without the address of this computer, because %s", problem)
        return None
    ports = endpoint.pose_port, endpoint.control_port
    return Announcer(Announcement(wire.name, *ports, has_keys, characters, relay_of), wire.host)
