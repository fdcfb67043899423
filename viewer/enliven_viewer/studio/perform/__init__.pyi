from .actions import (
    PERFORM_ACTIONS as PERFORM_ACTIONS,
    PerformAction as PerformAction,
    pressed as pressed,
)
from .holders import Holder as Holder
from .session import ROOMS as ROOMS, PerformSession as PerformSession
