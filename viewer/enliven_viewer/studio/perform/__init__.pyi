from .actions import NO_STAGE as NO_STAGE, make_perform_actions as make_perform_actions
from .cameras import Camera as Camera, CameraSearch as CameraSearch
from .close_up import CloseUp as CloseUp, find_pending_limb_box as find_pending_limb_box
from .holders import Holder as Holder
from .preview_placement import (
    DEFAULT_ASPECT as DEFAULT_ASPECT,
    PreviewPlacement as PreviewPlacement,
    ProjectedBody as ProjectedBody,
    find_rectangle as find_rectangle,
    project_bodies as project_bodies,
    find_aspect as find_aspect,
)
from .physics import LOOSE_LABELS as LOOSE_LABELS, LOOSE_WORLDS as LOOSE_WORLDS
from .recording import StageRecording as StageRecording
from .session import WORKSPACES as WORKSPACES, PerformSession as PerformSession
