from .checkpoints import Checkpoints as Checkpoints
from .diary import ScanDiary as ScanDiary
from .finish import (
    ENDINGS as ENDINGS,
    Keep as Keep,
    Made as Made,
    finished as finished,
    put_on_stage as put_on_stage,
    stage_command as stage_command,
    write_scan as write_scan,
)
from .growing import GrowingSurface as GrowingSurface
from .kept_scans import (
    keep_scan as keep_scan,
    kept_beside as kept_beside,
    refuse_unseen as refuse_unseen,
    scan_first as scan_first,
)
from .live_scan import Cast as Cast, LiveScan as LiveScan
from .missing import NextView as NextView, next_view as next_view
from .person import (
    FARTHEST as FARTHEST,
    PERSON_VOXEL as PERSON_VOXEL,
    PersonScanner as PersonScanner,
    ScannedPerson as ScannedPerson,
)
from .sheet import sheet_of as sheet_of
from .sources import recorded_images as recorded_images, sensor_images as sensor_images
from .things import said_of_things as said_of_things
