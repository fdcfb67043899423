from .checkpoints import Checkpoints as Checkpoints
from .scan_log import ScanLog as ScanLog
from .scan_mesh import (
    ENDINGS as ENDINGS,
    Keep as Keep,
    ScannedMesh as ScannedMesh,
    finished as finished,
    put_on_stage as put_on_stage,
    stage_command as stage_command,
    write_scan as write_scan,
)
from .surface_preview import SurfacePreview as SurfacePreview
from .kept_scans import (
    keep_scan as keep_scan,
    kept_beside as kept_beside,
    refuse_unseen as refuse_unseen,
    scan_first as scan_first,
)
from .live_scan import Cast as Cast, LiveScan as LiveScan
from .next_best_view import NextView as NextView, next_view as next_view
from .person import (
    FARTHEST as FARTHEST,
    PERSON_VOXEL as PERSON_VOXEL,
    PersonScanner as PersonScanner,
    ScannedPerson as ScannedPerson,
)
from .contact_sheet import sheet_of as sheet_of
from .sources import recorded_images as recorded_images, sensor_images as sensor_images
from .object_messages import said_of_things as said_of_things
