from .base import ImportOptions as ImportOptions, Reader as Reader, head_of as head_of, lens_of as lens_of
from .motion_capture import MotionCaptureReader as MotionCaptureReader
from .mirror import mirrored as mirrored
from .registry import find_files as find_files, find_reader as find_reader, readers as readers
