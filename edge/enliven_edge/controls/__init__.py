"""Controls beside a viewer's keys: pedals, clickers, button panels and spoken phrases.

A control is read on a thread of its own and says a command; the edge takes the commands between two frames.
"""

from enliven_edge.controls.control_set import Controls, open_controls
from enliven_edge.controls.lamps import Lamps, lamps_of
from enliven_edge.controls.settings import ControlSettings

__all__ = ["ControlSettings", "Controls", "Lamps", "lamps_of", "open_controls"]
