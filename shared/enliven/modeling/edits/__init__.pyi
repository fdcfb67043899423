from .characters import (
    change_layers,
    copy_character,
    cut_character,
    delete_character,
    mirror_character,
    move_character,
    paste_character,
    rename_character,
    scale_character,
    shift_character,
    turn_character,
)
from .merging import merge_characters
from .rigs import RIGS, RigEdits, pose_of_character, rig_of, vertices_of

__all__ = [
    "RIGS",
    "RigEdits",
    "change_layers",
    "copy_character",
    "cut_character",
    "delete_character",
    "merge_characters",
    "mirror_character",
    "move_character",
    "paste_character",
    "pose_of_character",
    "rename_character",
    "rig_of",
    "scale_character",
    "shift_character",
    "turn_character",
    "vertices_of",
]
