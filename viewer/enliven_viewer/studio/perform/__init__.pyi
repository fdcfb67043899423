from .actions import NO_STAGE as NO_STAGE, perform_actions as perform_actions, pressed as pressed
from .holders import Holder as Holder
from .recording import StageRecording as StageRecording
from .session import ROOMS as ROOMS, PerformSession as PerformSession
