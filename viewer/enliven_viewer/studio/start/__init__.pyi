from .chair_legs import find_leg_to_cut as find_leg_to_cut, find_legs as find_legs
from .tour_steps import TOUR_STEPS as TOUR_STEPS, TourPart as TourPart, TourStep as TourStep
from .target import DrawnWidgets as DrawnWidgets, Target as Target
from .tour import Tour as Tour
