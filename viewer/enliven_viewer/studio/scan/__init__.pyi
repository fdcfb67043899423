from .actions import scan_actions as scan_actions
from .growing import GrowingMesh as GrowingMesh
from .marks import scan_marks as scan_marks
from .session import ScanSession as ScanSession, Size as Size
from .words import Advice as Advice, advice_of as advice_of
