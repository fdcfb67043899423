from .actions import scan_actions as scan_actions
from .box import DraggedBox as DraggedBox, box_about as box_about
from .growing import GrowingMesh as GrowingMesh
from .marks import scan_marks as scan_marks
from .session import Kept as Kept, ScanSession as ScanSession, Size as Size, Way as Way
from .words import Advice as Advice, advice_of as advice_of
