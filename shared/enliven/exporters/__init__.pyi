from .performance import Performance
from .registry import Exporter, exporter_of, suffixes
from .sampling import end_of, performance_of, performance_of_clip

__all__ = [
    "Exporter",
    "Performance",
    "end_of",
    "exporter_of",
    "performance_of",
    "performance_of_clip",
    "suffixes",
]
