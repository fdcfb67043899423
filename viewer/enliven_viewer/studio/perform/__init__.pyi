from .actions import perform_actions as perform_actions, pressed as pressed
from .holders import Holder as Holder
from .session import ROOMS as ROOMS, PerformSession as PerformSession
