from .body_takes import (
    RecordedHolds as RecordedHolds,
    body_take_of as body_take_of,
    body_take_of_frames as body_take_of_frames,
    recorded_holds as recorded_holds,
)
from .capture_clip import BODY_NAMES as BODY_NAMES, clip_of_bodies as clip_of_bodies
from .capture_limbs import (
    half_way as half_way,
    limb_rotations as limb_rotations,
    smoothstep as smoothstep,
)
from .capture_roles import Roles as Roles, find_roles as find_roles
from .capture_upright import (
    leg_length as leg_length,
    read_capture as read_capture,
    upright_capture as upright_capture,
)
from .exportable import Exportable as Exportable, exportables_of as exportables_of
from .files import read_take as read_take
from .live_layer import LiveLayer as LiveLayer
from .performed import (
    ONLOOKER as ONLOOKER,
    PerformedMotion as PerformedMotion,
    with_performed as with_performed,
)
from .overdub import LiveOverdub as LiveOverdub, plays as plays
from .positions import turns_of as turns_of
from .possessed import possession_in as possession_in, read_possessed as read_possessed
from .recorded import clips_of_recording as clips_of_recording
