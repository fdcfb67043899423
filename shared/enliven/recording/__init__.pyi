from .container import MAGIC as MAGIC
from .messages import pack_depth as pack_depth, unpack_depth as unpack_depth
from .reader import (
    Recording as Recording,
    RecordingInfo as RecordingInfo,
    RecordingWarning as RecordingWarning,
    frame_from_message as frame_from_message,
)
from .recorder import Recorder as Recorder
from .recovery import Recovery as Recovery, recover as recover
from .schemas import BODIES_TOPIC as BODIES_TOPIC, DEPTH_TOPIC as DEPTH_TOPIC, MessageKind as MessageKind
