from .disk_sync import DiskSync
from .take import Take

__all__ = ["DiskSync", "Take"]
