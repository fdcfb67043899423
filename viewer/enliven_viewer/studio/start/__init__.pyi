from .chair_legs import leg_to_cut as leg_to_cut, legs_of as legs_of
from .tour_steps import TOUR as TOUR, TourPart as TourPart, TourStep as TourStep
from .target import DrawnWidgets as DrawnWidgets, Target as Target
from .tour import Tour as Tour
