from .disk_sync import DiskSync as DiskSync
from .parts import PartedRecorder as PartedRecorder, free_path as free_path
from .take import Take as Take
