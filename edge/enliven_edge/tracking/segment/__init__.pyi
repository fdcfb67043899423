from .candidate import YOUNG as YOUNG, Candidate as Candidate
from .candidates import Candidates as Candidates
from .segmentation import Segments as Segments, lying_on as lying_on, segmented as segmented
