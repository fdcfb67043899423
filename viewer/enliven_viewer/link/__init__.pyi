from .edge_feed import EdgeFeed as EdgeFeed
from .edge_client import EdgeClient as EdgeClient
from .feed import Feed as Feed
from .edge_connection import NO_ANSWER_TEXT as NO_ANSWER_TEXT
from .received_data import ReceivedCues as ReceivedCues
from .stage_link import StageLink as StageLink
from .take_feed import TakeFeed as TakeFeed
