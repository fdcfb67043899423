from .actions import make_scan_actions as make_scan_actions
from .crop_box import CropBox as CropBox, find_initial_box as find_initial_box
from .scan_preview import ScanPreviewMesh as ScanPreviewMesh
from .camera_marks import make_scan_marks as make_scan_marks
from .scan_session import (
    KeptPart as KeptPart,
    ScanSession as ScanSession,
    ScanSize as ScanSize,
    ScanMode as ScanMode,
)
from .scan_advice import Advice as Advice, choose_advice as choose_advice
