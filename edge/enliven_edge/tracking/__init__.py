"""The tracker: depth frames in, 20 joints of each person out.

The rooms follow a frame's way: ``frame`` checks and reduces it, ``scene`` knows the room, ``segment`` parts
people from it, ``body_model``, ``fit`` and ``detect`` find each posture, ``people`` keeps who is who,
``output`` smooths and ``health`` says what is wrong. An import never runs back along this way.
"""

from enliven_edge.tracking.settings import SceneSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker

__all__ = ["SceneSettings", "Tracker", "TrackerSettings"]
