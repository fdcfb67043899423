from .checkpoints import Checkpoints as Checkpoints
from .scan_log import ScanLog as ScanLog
from .scan_mesh import (
    ENDINGS as ENDINGS,
    Keep as Keep,
    ScannedMesh as ScannedMesh,
    finish_scan as finish_scan,
    put_on_stage as put_on_stage,
    stage_command as stage_command,
    write_scan as write_scan,
)
from .surface_preview import SurfacePreview as SurfacePreview
from .kept_scans import (
    store_scan as store_scan,
    stored_scan_path as stored_scan_path,
    check_registered as check_registered,
    load_first_part as load_first_part,
)
from .live_scan import Cast as Cast, LiveScan as LiveScan
from .next_best_view import NextView as NextView, find_next_view as find_next_view
from .person import (
    MAX_PERSON_DISTANCE_M as MAX_PERSON_DISTANCE_M,
    PERSON_VOXEL_M as PERSON_VOXEL_M,
    PersonScanner as PersonScanner,
    ScannedPerson as ScannedPerson,
)
from .contact_sheet import draw_contact_sheet as draw_contact_sheet
from .sources import recorded_images as recorded_images, sensor_images as sensor_images
from .object_messages import describe_objects as describe_objects
