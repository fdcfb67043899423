from .probing import way_of
from .showing import WAYS, Way, shown

__all__ = ["WAYS", "Way", "shown", "way_of"]
