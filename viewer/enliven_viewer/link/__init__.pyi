from .edge_feed import EdgeFeed as EdgeFeed
from .edges import EdgeClient as EdgeClient
from .feed import Feed as Feed
from .stage_link import StageLink as StageLink
from .take_feed import TakeFeed as TakeFeed
