"""Readers of foreign recordings, found by name or by the files' content.

A reader turns files of one layout into frames of enliven; other packages add readers by the entry-point
group ``enliven.readers``.
"""

from enliven_edge.importing.base import ImportOptions, Reader
from enliven_edge.importing.mirror import mirrored
from enliven_edge.importing.registry import find_files, find_reader, readers

__all__ = ["ImportOptions", "Reader", "find_files", "find_reader", "mirrored", "readers"]
