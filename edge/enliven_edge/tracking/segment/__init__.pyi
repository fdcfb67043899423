from .candidate import YOUNG as YOUNG, Candidate as Candidate
from .candidates import Candidates as Candidates
from .furniture import BESIDE as BESIDE, furniture_beside as furniture_beside
from .segmentation import Segments as Segments, lying_on as lying_on, segmented as segmented
