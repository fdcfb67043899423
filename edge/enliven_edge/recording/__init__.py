"""The take of a performance: written while it is performed, and readable up to the moment that the disk is
full.
"""

from enliven_edge.recording.disk_sync import DiskSync
from enliven_edge.recording.take import Take

__all__ = ["DiskSync", "Take"]
