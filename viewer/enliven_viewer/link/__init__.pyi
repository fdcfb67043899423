from .edge_feed import EdgeFeed as EdgeFeed
from .edges import EdgeClient as EdgeClient
from .feed import Feed as Feed
from .one_edge import NO_ANSWER as NO_ANSWER
from .received import ReceivedCues as ReceivedCues
from .stage_link import StageLink as StageLink
from .take_feed import TakeFeed as TakeFeed
