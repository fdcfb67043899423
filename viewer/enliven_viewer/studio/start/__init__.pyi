from .legs import legs_of as legs_of
from .steps import TOUR as TOUR, TourPart as TourPart, TourStep as TourStep
from .target import DrawnWidgets as DrawnWidgets, Target as Target
from .tour import Tour as Tour
