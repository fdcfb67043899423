from .characters import (
    change_layers as change_layers,
    copy_character as copy_character,
    cut_character as cut_character,
    delete_character as delete_character,
    drag_handle as drag_handle,
    mirror_character as mirror_character,
    move_character as move_character,
    paste_character as paste_character,
    remove_layer as remove_layer,
    rename_character as rename_character,
    scale_character as scale_character,
    shift_character as shift_character,
    turn_character as turn_character,
)
from .clips import (
    blend_clips as blend_clips,
    clips_of as clips_of,
    mirror_layers as mirror_layers,
    move_clip as move_clip,
    remove_clip as remove_clip,
    reverse_clip as reverse_clip,
    slip_clip as slip_clip,
    split_clip as split_clip,
    stretch_clip as stretch_clip,
    trim_clip as trim_clip,
)
from .handling import (
    delete_take as delete_take,
    handle_characters as handle_characters,
    order_characters as order_characters,
    refuse_locked as refuse_locked,
    rename_take as rename_take,
)
from .markers import (
    add_marker as add_marker,
    move_marker as move_marker,
    remove_marker as remove_marker,
    rename_marker as rename_marker,
)
from .merging import merge_characters as merge_characters
from .rigs import (
    RIGS as RIGS,
    pose_of_character as pose_of_character,
    rig_of as rig_of,
    vertices_of as vertices_of,
)
