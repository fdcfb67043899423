from .edge_feed import EdgeFeed
from .edges import EdgeClient
from .feed import Feed
from .take_feed import TakeFeed

__all__ = ["EdgeClient", "EdgeFeed", "Feed", "TakeFeed"]
