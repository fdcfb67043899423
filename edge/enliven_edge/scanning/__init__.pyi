from .checkpoints import Checkpoints as Checkpoints
from .diary import ScanDiary as ScanDiary
from .finish import (
    ENDINGS as ENDINGS,
    finished as finished,
    put_on_stage as put_on_stage,
    stage_command as stage_command,
    write_scan as write_scan,
)
from .growing import GrowingSurface as GrowingSurface
from .live_scan import LiveScan as LiveScan
from .missing import NextView as NextView, next_view as next_view
from .sheet import sheet_of as sheet_of
from .things import said_of_things as said_of_things
