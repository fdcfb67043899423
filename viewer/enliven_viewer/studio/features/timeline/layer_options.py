"""Draws the numbers and switches of a layer, for characters with any rig."""

from __future__ import annotations

from dataclasses import fields

from imgui_bundle import ImVec2, imgui

from enliven.document import FEET, Layer, LayerBase, Project, RigBase, RiggedCharacter
from enliven.modeling.edits import (
    change_layers,
    foot_lock_mode,
    list_alternative_takes,
    lock_feet,
    remove_layer,
)
from enliven.motion.layers.retarget import set_travel
from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import Change, draw_slider, draw_switch, draw_tooltip
from enliven_viewer.studio.app.lane_groups import find_lane_layers
from enliven_viewer.studio.app.style import draw_heading, draw_note
from enliven_viewer.studio.features.timeline.take_commands import TakeCommands
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput

_NUMBER_RANGES = {
    "weight": (0.0, 1.0, later("weight %.2f")),
    "offset": (-5.0, 30.0, later("begins at %.2f s")),
    "speed": (-3.0, 3.0, later("speed %.2f")),
    "smooth": (0.0, 0.5, later("smoothed over %.2f s")),
    "ease": (0.0, 1.0, later("fades in and out in %.2f s")),
}
"""The (minimum, maximum, number format) of each number."""
_MIN_SPEED = 0.02
"""Minimum speed of the slider. At speed 0 nothing plays."""
_SWITCH_TIPS = {
    "loop": later("Starts again when the motion ends"),
    "muted": later("This motion does not play"),
    "hold": later(
        "Holds the first frame before the clips and the last frame after the clips. If off, nothing "
        "plays there"
    ),
    "mirrored": later("Plays the take's mirror image: left and right are swapped"),
    "travel": later("The puppet walks through the scene as the performer does"),
    "level_feet": later("Both feet keep the same height while the weight moves from one foot to the other"),
}
"""Tooltips of the switches. The rig determines which switches a layer has."""
_LABELS = {
    "weight": later("weight"),
    "offset": later("offset"),
    "speed": later("speed"),
    "smooth": later("smooth"),
    "ease": later("ease"),
    "loop": later("loop"),
    "muted": later("muted"),
    "hold": later("hold"),
    "mirrored": later("mirrored"),
    "travel": later("travel"),
    "level_feet": later("level feet"),
}
"""Labels of the numbers and switches."""
_FOOT_LOCK_LABELS = {
    "auto": later("Auto: feet stay where they stand"),
    "always": later("Always: no foot slides"),
    "never": later("Never: as performed"),
    "ground": later("Grounding: no foot below the floor"),
}
"""Labels of the foot lock modes."""
_SECOND_SWITCH_X = 126.0
"""Horizontal position in pixels of the second of two switches."""


def draw_layer(app: App, timeline: TimelineInput, character: RigBase, number: int) -> None:
    """Draws the numbers and switches of a layer."""
    editor, name, layer = app.editor, character.id, character.playing[number]
    frame = imgui.get_frame_count()
    old_layer, timeline.shown_layer = timeline.shown_layer, (name, number, frame)
    if timeline.busy and old_layer != (name, number, frame - 1):
        imgui.set_scroll_here_y(0.0)  # The user has clicked a clip, so scroll its options into view.
    draw_heading("Chosen motion")
    imgui.text_unformatted(getattr(layer, "id", layer.take))
    imgui.same_line(imgui.get_content_region_avail().x - 52)
    if imgui.small_button(labelled(tr("Remove"), "remove layer")):
        editor.edit("remove a layer", lambda project: remove_layer(project, name, number))
        return
    app.remember("remove layer")
    draw_note(tr("take {0}", layer.take))
    _draw_takes(app, layer)
    field_names = {field.name for field in fields(layer)}  # type: ignore[arg-type]
    if layer.source != "takes":
        # Recorded streams cannot be mirrored, because their positions are absolute.
        field_names.discard("mirrored")
    for field, (low, high, pattern) in _NUMBER_RANGES.items():
        if field in field_names:
            change = _make_change(name, number, field)
            draw_slider(app, f"layer {_LABELS[field]}", getattr(layer, field), low, high, pattern, change)
    for place, field in enumerate(field for field in _SWITCH_TIPS if field in field_names):
        if place % 2:
            imgui.same_line(_SECOND_SWITCH_X)
        label, change = _LABELS[field], _make_change(name, number, field)
        draw_switch(app, label, getattr(layer, field), change, _SWITCH_TIPS[field])
    if isinstance(layer, Layer):
        _draw_chain_options(app, editor.project.shape(name), layer, number)
    if (feet := foot_lock_mode(character, number)) is not None:
        _draw_foot_lock(app, character, number, feet)


def _draw_takes(app: App, layer: LayerBase) -> None:
    """Draws the alternative takes of a lane with a mark at the active take, and a delete button for each."""
    takes = TakeCommands(app.editor)
    alternatives = list_alternative_takes(app.editor.project, layer.alternatives)
    if len(alternatives) < 2:
        return
    draw_note("takes of this lane")
    for recorded, is_audible in alternatives.items():
        if imgui.radio_button(f"{recorded}###heard {recorded}", is_audible) and not is_audible:
            takes.choose(recorded)
        app.remember(f"hear {recorded}")
        imgui.same_line(imgui.get_content_region_avail().x - 44)
        if imgui.small_button(labelled(tr("Delete"), f"delete {recorded}")):
            takes.drop(recorded)
        app.remember(f"drop {recorded}")


def _make_change(name: str, number: int, field: str) -> Change:
    """Returns the edit that sets one field of a layer."""

    def change(project: Project, value: float) -> Project:
        if field == "speed" and abs(value) < _MIN_SPEED:
            value = _MIN_SPEED
        return change_layers(project, name, [number], **{field: value})

    return change


def _draw_chain_options(app: App, shape: RiggedCharacter, layer: Layer, number: int) -> None:
    """Draws the options that only layers of bones have: inverse kinematics of the chain's end, and root
    motion.
    """

    def lead(project: Project, on: float) -> Project:
        return change_layers(project, shape.id, [number], mode="end" if on else "turns")

    def travel(project: Project, on: float) -> Project:
        return set_travel(project, shape.id, layer.id if on else None)

    tip = tr("Bends the chain so that its end follows the end of the take's chain")
    draw_switch(app, "lead the end", layer.mode == "end", lead, tip)
    tip = tr("The shape follows the root of the take through the scene. Press P to pin a chosen foot.")
    draw_switch(app, "root travels", shape.travel == layer.id, travel, tip)


def _draw_foot_lock(app: App, character: RigBase, number: int, feet: str) -> None:
    """Draws the foot lock mode for the clips of the lane. A change is one edit of all layers in the lane."""
    name, jointed = character.id, character.jointed
    draw_note("feet")
    imgui.set_next_item_width(-1)
    changed, mode_number = imgui.combo(
        "##feet", FEET.index(feet), [tr(_FOOT_LOCK_LABELS[mode]) for mode in FEET]
    )
    app.remember("feet")
    if jointed:
        draw_tooltip("All modes except Auto also find feet that you have not pinned (P)")
    else:
        draw_tooltip(
            "Feet are the parts that touch the floor in the rest pose, or the feet that you marked (E)"
        )
    is_requested = False
    if not jointed and feet != "never":
        is_requested = imgui.button(
            labelled(tr("Detect the feet again"), "Detect the feet again"), ImVec2(-1, 0)
        )
        app.remember("feet again")
        draw_tooltip("Detects the feet in the current motion. Do this again after you edit the clips")
    if is_requested or (changed and FEET[mode_number] != feet):
        numbers, foot_lock = find_lane_layers(app.editor.project, name, number), FEET[mode_number]
        app.editor.edit(
            later("feet: {0}", _FOOT_LOCK_LABELS[foot_lock]),
            lambda project: lock_feet(project, name, numbers, foot_lock),
        )
