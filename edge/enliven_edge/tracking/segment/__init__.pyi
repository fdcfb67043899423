from .candidates import YOUNG, Newcomer, Newcomers
from .segmentation import Segments, lying_on, segmented

__all__ = ["YOUNG", "Newcomer", "Newcomers", "Segments", "lying_on", "segmented"]
