from .control_set import Controls, open_controls
from .lamps import Lamps, lamps_of
from .settings import ControlSettings

__all__ = ["ControlSettings", "Controls", "Lamps", "lamps_of", "open_controls"]
