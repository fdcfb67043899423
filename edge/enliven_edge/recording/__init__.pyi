from .disk_sync import DiskSync as DiskSync
from .take import Take as Take
