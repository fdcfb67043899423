from .candidate import MAX_YOUNG_AGE_S as MAX_YOUNG_AGE_S, Candidate as Candidate
from .candidates import Candidates as Candidates
from .furniture import MAX_CLOTHES_DISTANCE_M as MAX_CLOTHES_DISTANCE_M, find_furniture as find_furniture
from .segmentation import (
    Segments as Segments,
    pixels_near_bodies as pixels_near_bodies,
    segment_people as segment_people,
)
