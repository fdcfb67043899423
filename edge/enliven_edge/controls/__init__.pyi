from .base import Call as Call
from .control_set import Controls as Controls, open_controls as open_controls
from .panel_protocol import Lamps as Lamps, lamps_of as lamps_of
from .settings import ControlSettings as ControlSettings
