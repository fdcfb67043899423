from .actions import scan_actions as scan_actions
from .crop_box import CropBox as CropBox, box_about as box_about
from .scan_preview import ScanPreviewMesh as ScanPreviewMesh
from .camera_marks import scan_marks as scan_marks
from .scan_session import (
    KeptPart as KeptPart,
    ScanSession as ScanSession,
    ScanSize as ScanSize,
    ScanMode as ScanMode,
)
from .scan_advice import Advice as Advice, advice_of as advice_of
