from .actor import Actor as Actor, Mode as Mode
from .actor_settings import ActorSettings as ActorSettings, AttachmentSettings as AttachmentSettings
from .attachment.bone_attachment import Attachment as Attachment, attach as attach
from .easing.pose_blend import PoseBlend as PoseBlend
from .embedded_actor import EmbeddedActor as EmbeddedActor
from .highlights import Cues as Cues, State as State, make_cues as make_cues
from .likeness.skeleton import BodyInMesh as BodyInMesh
from .likeness.finding import find_person_in_mesh as find_person_in_mesh
from .placement import body_yaw as body_yaw, rotation_about_y as rotation_about_y
from .placement_rules import needs_person_search as needs_person_search
from .preparation import (
    PreparedMesh as PreparedMesh,
    apply_vertex_motion as apply_vertex_motion,
    prepare_mesh as prepare_mesh,
    prepare_for_actor as prepare_for_actor,
)
from .replaying import replay as replay, settings_from_possession as settings_from_possession
from .likeness.standing_person import make_standing_figure as make_standing_figure
