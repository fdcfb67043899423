"""Pictures in a terminal, by its own image protocol where it has one, else in coloured half blocks."""

from enliven_edge.terminal.probing import way_of
from enliven_edge.terminal.showing import WAYS, Way, shown

__all__ = ["WAYS", "Way", "shown", "way_of"]
