from .actions import NO_STAGE as NO_STAGE, perform_actions as perform_actions
from .cameras import Camera as Camera, CameraSearch as CameraSearch
from .close_up import CloseUp as CloseUp, pending_limb_box as pending_limb_box
from .holders import Holder as Holder
from .preview_placement import (
    WIDER as WIDER,
    PreviewPlacement as PreviewPlacement,
    ProjectedBody as ProjectedBody,
    rectangle_of as rectangle_of,
    project_bodies as project_bodies,
    width_of as width_of,
)
from .physics import LOOSE_LABELS as LOOSE_LABELS, LOOSE_WORLDS as LOOSE_WORLDS
from .recording import StageRecording as StageRecording
from .session import ROOMS as ROOMS, PerformSession as PerformSession
