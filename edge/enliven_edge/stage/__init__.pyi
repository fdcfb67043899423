from .casting import cast as cast, name_of as name_of, parts_for as parts_for
from .opening import Opening as Opening
from .stage import Stage as Stage
from .tick import Tick as Tick
