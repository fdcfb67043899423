from .attachment import Attachment, AttachmentSettings, Growth, attach
from .body_in_mesh import BodyInMesh, find_body_in_mesh
from .bone_cylinders import bone_rotations, filled_joints

__all__ = [
    "Attachment",
    "AttachmentSettings",
    "BodyInMesh",
    "Growth",
    "attach",
    "bone_rotations",
    "filled_joints",
    "find_body_in_mesh",
]
