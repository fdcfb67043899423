from .body_takes import (
    RecordedHolds as RecordedHolds,
    body_take_from_file as body_take_from_file,
    body_take_from_frames as body_take_from_frames,
    recorded_holds as recorded_holds,
)
from .capture_clip import BODY_NAMES as BODY_NAMES, clip_of_bodies as clip_of_bodies
from .capture_limbs import (
    path_midpoint as path_midpoint,
    find_limb_rotations as find_limb_rotations,
    smoothstep as smoothstep,
)
from .capture_roles import Roles as Roles, find_roles as find_roles
from .capture_upright import (
    leg_length as leg_length,
    read_capture as read_capture,
    turn_upright as turn_upright,
)
from .exportable import Exportable as Exportable, find_exportables as find_exportables
from .files import read_take as read_take
from .live_layer import LiveLayer as LiveLayer
from .performed import (
    ONLOOKER_SUFFIX as ONLOOKER_SUFFIX,
    PerformedMotion as PerformedMotion,
    add_performance as add_performance,
)
from .overdub import LiveOverdub as LiveOverdub, has_motion as has_motion
from .positions import rotations_from_positions as rotations_from_positions
from .possessed import read_possession as read_possession, read_possessed as read_possessed
from .recorded import clips_of_recording as clips_of_recording
