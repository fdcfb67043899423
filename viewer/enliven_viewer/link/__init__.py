"""The link to edges and takes: messages received, clocks aligned, requests sent."""

from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.link.edges import Link
from enliven_viewer.link.feed import Feed
from enliven_viewer.link.take_feed import Take

__all__ = ["EdgeFeed", "Feed", "Link", "Take"]
