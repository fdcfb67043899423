from .candidate import YOUNG, Candidate
from .candidates import Candidates
from .segmentation import Segments, lying_on, segmented

__all__ = ["YOUNG", "Candidate", "Candidates", "Segments", "lying_on", "segmented"]
