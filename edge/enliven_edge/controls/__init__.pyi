from .base import Call as Call
from .control_set import Controls as Controls, open_controls as open_controls
from .panel_protocol import Lamps as Lamps, lamps_from_state as lamps_from_state
from .settings import ControlSettings as ControlSettings
