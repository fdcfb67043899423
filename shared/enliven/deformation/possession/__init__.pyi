from .attachment import Attachment, AttachmentSettings, Growth, attach
from .body_in_mesh import Likeness, likeness
from .bone_cylinders import bone_rotations, filled

__all__ = [
    "Attachment",
    "AttachmentSettings",
    "Growth",
    "Likeness",
    "attach",
    "bone_rotations",
    "filled",
    "likeness",
]
