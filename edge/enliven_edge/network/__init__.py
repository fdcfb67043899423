"""The edge's network: TCP servers with bounded queues, the streams to viewers, and the requests from them."""

from enliven_edge.network.descriptors import raise_descriptor_limit
from enliven_edge.network.frame_rate import Pace
from enliven_edge.network.listening import check_open
from enliven_edge.network.outlet import Outlet, need_free

__all__ = ["Outlet", "Pace", "check_open", "need_free", "raise_descriptor_limit"]
