from .take import DiskSync as DiskSync
from .take import Take as Take
