"""Segmentation: which pixels belong to which person, and which groups of pixels may be a new one."""

from enliven_edge.tracking.segment.candidates import YOUNG, Newcomer, Newcomers
from enliven_edge.tracking.segment.segmentation import Segments, lying_on, segmented

__all__ = ["YOUNG", "Newcomer", "Newcomers", "Segments", "lying_on", "segmented"]
