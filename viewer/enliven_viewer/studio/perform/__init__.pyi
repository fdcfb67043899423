from .actions import (
    PERFORM_ACTIONS as PERFORM_ACTIONS,
    PerformAction as PerformAction,
    pressed as pressed,
)
from .holders import Holder as Holder
from .performance import ROOMS as ROOMS, Performance as Performance
