"""The edge's network: TCP servers with bounded queues, the streams to viewers, and the requests from them."""

from enliven_edge.network.connection import Connection
from enliven_edge.network.descriptors import raise_descriptor_limit
from enliven_edge.network.listening import check_open
from enliven_edge.network.server import ZmtpServer

__all__ = ["Connection", "ZmtpServer", "check_open", "raise_descriptor_limit"]
