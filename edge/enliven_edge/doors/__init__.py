"""Where strangers come in: who is let in, what is read of them and sent to them, each within bounds."""

from enliven_edge.doors.connection import Connection
from enliven_edge.doors.descriptors import raise_descriptor_limit
from enliven_edge.doors.door import Door
from enliven_edge.doors.listening import check_open

__all__ = ["Connection", "Door", "check_open", "raise_descriptor_limit"]
