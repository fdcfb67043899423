from .anchoring import stand as stand
from .bounded import Nodes as Nodes
from .constraints import Conditions as Conditions, conditions_of as conditions_of
from .following import PathFollower as PathFollower, from_floor as from_floor, on_floor as on_floor
from .locomotion import (
    PlacedMotion as PlacedMotion,
    check_switches as check_switches,
    find_switches as find_switches,
    locate as locate,
    standing_feet as standing_feet,
)
from .nearest import Nearest as Nearest
from .planting import planted as planted
from .spacetime import Solution as Solution, solve as solve
