from .base import (
    ImportOptions as ImportOptions,
    Reader as Reader,
    read_head as read_head,
    parse_lens as parse_lens,
)
from .motion_capture import MotionCaptureReader as MotionCaptureReader
from .mirror import mirror_frames as mirror_frames
from .registry import find_files as find_files, find_reader as find_reader, readers as readers
