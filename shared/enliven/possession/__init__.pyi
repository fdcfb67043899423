from .actor import Actor as Actor, Mode as Mode
from .actor_settings import ActorSettings as ActorSettings
from .attachment import Attachment as Attachment, AttachmentSettings as AttachmentSettings, attach as attach
from .pose_blend import PoseBlend as PoseBlend
from .embedded_actor import EmbeddedActor as EmbeddedActor
from .highlights import Cues as Cues, State as State, cues_of as cues_of
from .likeness import BodyInMesh as BodyInMesh, find_person_in_mesh as find_person_in_mesh
from .placement import facing as facing, turn_about_y as turn_about_y
from .placement_rules import seeks_person as seeks_person
from .preparation import (
    PreparedMesh as PreparedMesh,
    as_moved as as_moved,
    prepared as prepared,
    prepared_as as prepared_as,
)
from .replaying import replay as replay, settings_of as settings_of
from .standing_placement import standing_figure as standing_figure
