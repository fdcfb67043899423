from .edge_feed import EdgeFeed
from .edges import Link
from .feed import Feed
from .take_feed import Take

__all__ = ["EdgeFeed", "Feed", "Link", "Take"]
