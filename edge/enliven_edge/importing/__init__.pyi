from .base import ImportOptions, Reader
from .mirror import mirrored
from .registry import find_files, find_reader, readers

__all__ = ["ImportOptions", "Reader", "find_files", "find_reader", "mirrored", "readers"]
