"""Sensor streams and takes on disk: MCAP files that other tools can open.

:class:`Recorder` writes, :class:`Recording` reads. Topics, schemas and layouts are in
:mod:`enliven.recording.schemas`.
"""

from enliven.recording.reader import Recording, RecordingInfo, RecordingWarning, TopicInfo
from enliven.recording.recorder import Recorder
from enliven.recording.schemas import BODIES_TOPIC, DEPTH_TOPIC, TRUTH_TOPIC

__all__ = [
    "BODIES_TOPIC",
    "DEPTH_TOPIC",
    "TRUTH_TOPIC",
    "Recorder",
    "Recording",
    "RecordingInfo",
    "RecordingWarning",
    "TopicInfo",
]
