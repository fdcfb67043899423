from .take_comping import (
    find_alternatives as find_alternatives,
    group_as_take as group_as_take,
    choose_take as choose_take,
    drop_take as drop_take,
    keep_take as keep_take,
    list_alternative_takes as list_alternative_takes,
)
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
    find_layer_clips as find_layer_clips,
    mirror_layers as mirror_layers,
    move_clip as move_clip,
    remove_clip as remove_clip,
    reverse_clip as reverse_clip,
    slip_clip as slip_clip,
    split_clip as split_clip,
    stretch_clip as stretch_clip,
    trim_clip as trim_clip,
)
from .feet import foot_lock_mode as foot_lock_mode, lock_feet as lock_feet
from .performance_transfer import (
    transfer_performance as transfer_performance,
    performance_in as performance_in,
)
from .groups import (
    copy_characters as copy_characters,
    group_centre as group_centre,
    mirror_characters as mirror_characters,
    move_characters as move_characters,
    mute_characters as mute_characters,
    scale_characters as scale_characters,
    shift_characters as shift_characters,
    turn_characters as turn_characters,
)
from .visibility import (
    delete_take as delete_take,
    handle_characters as handle_characters,
    order_characters as order_characters,
    refuse_locked as refuse_locked,
    rename_take as rename_take,
)
from .keying import key_characters as key_characters, key_handle as key_handle
from .keys import (
    ease_key as ease_key,
    key_at as key_at,
    key_layer as key_layer,
    find_keys as find_keys,
    move_key as move_key,
    remove_key as remove_key,
    set_key as set_key,
)
from .layer_curves import (
    layer_keys as layer_keys,
    move_layer_key as move_layer_key,
    remove_layer_key as remove_layer_key,
    set_layer_key as set_layer_key,
)
from .markers import (
    add_marker as add_marker,
    move_marker as move_marker,
    remove_marker as remove_marker,
    rename_marker as rename_marker,
)
from .merging import merge_characters as merge_characters
from .painting import (
    MAX_DOUBLINGS as MAX_DOUBLINGS,
    Brush as Brush,
    brush_stiffness as brush_stiffness,
    paint_character as paint_character,
    unpaint_character as unpaint_character,
)
from .root_layers import (
    RigidMotion as RigidMotion,
    root_motion as root_motion,
    root_motions as root_motions,
)
from .rigs import (
    RIGS as RIGS,
    bake_root_layers as bake_root_layers,
    find_base_centre as find_base_centre,
    pose_of_character as pose_of_character,
    get_rig_edits as get_rig_edits,
    compute_vertices as compute_vertices,
)
