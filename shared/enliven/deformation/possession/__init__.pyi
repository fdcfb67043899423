from .attachment import (
    Attachment as Attachment,
    AttachmentSettings as AttachmentSettings,
    Growth as Growth,
    attach as attach,
)
from .body_in_mesh import BodyInMesh as BodyInMesh, find_body_in_mesh as find_body_in_mesh
from .bone_cylinders import bone_rotations as bone_rotations, filled_joints as filled_joints
