"""Possession: which graph nodes a performer's bones take hold of (KinÊtre, 2012)."""

from enliven.deformation.possession.attachment import Attachment, AttachmentSettings, Growth, attach
from enliven.deformation.possession.body_in_mesh import Likeness, likeness
from enliven.deformation.possession.bone_cylinders import bone_rotations, filled

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
