"""The edge's TCP ports: connections, bytes read and bytes queued, each within stated bounds."""

from enliven_edge.network.connection import Connection
from enliven_edge.network.descriptors import raise_descriptor_limit
from enliven_edge.network.listening import check_open
from enliven_edge.network.server import ZmtpServer

__all__ = ["Connection", "ZmtpServer", "check_open", "raise_descriptor_limit"]
