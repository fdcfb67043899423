from .performance import Performance as Performance
from .registry import Exporter as Exporter, exporter_of as exporter_of, suffixes as suffixes
from .sampling import (
    Representation as Representation,
    performance_of as performance_of,
    performance_of_clip as performance_of_clip,
    stick_mesh as stick_mesh,
)
