from .reader import Recording, RecordingInfo, RecordingWarning, frame_of
from .recorder import Recorder
from .recovery import Recovery, recover
from .schemas import BODIES_TOPIC, DEPTH_TOPIC

__all__ = [
    "BODIES_TOPIC",
    "DEPTH_TOPIC",
    "Recorder",
    "Recording",
    "RecordingInfo",
    "RecordingWarning",
    "Recovery",
    "frame_of",
    "recover",
]
