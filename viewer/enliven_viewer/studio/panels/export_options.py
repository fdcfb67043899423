"""Draws the options of an export or film above the file list: characters, range, rate, size, look, format."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven.exporters import IN_PLACE, MAX_SCALE, SCALE, UNIT, UP
from enliven_viewer.language import labelled, tr
from enliven_viewer.render.stage_look import LOOKS
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.style import draw_note
from enliven_viewer.studio.workspace.exporting import FILM_SIZES, FRAME_RATES, list_supported_options
from enliven_viewer.studio.workspace.files import EXPORT_SUFFIXES
from enliven_viewer.studio.workspace.workspace import Workspace

_LABEL_WIDTH = 96.0
"""Width in pixels of the label before a field."""
_FIELD_WIDTH = 110.0
"""Width of a field in pixels."""
_AXIS_WIDTH = 56.0
"""Width in pixels of the choice of the vertical axis."""
_SCALE_FLAGS = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp
_CHARACTERS_HEIGHT = 74.0
"""Height in pixels of the list of characters: three lines."""


def draw_export_options(workspace: Workspace, *, film: bool) -> None:
    """Draws the options of an export, or of a film."""
    options, editor = workspace.exporting, workspace.editor
    solid = [character for character in editor.project.characters.values() if character.mesh is not None]
    if len(solid) > 1:
        imgui.begin_child("##characters", ImVec2(0, min(_CHARACTERS_HEIGHT, 24.0 * len(solid))))
        for character in solid:
            ticked = imgui.checkbox(
                f"{character.id}##export {character.id}", character.id not in options.left_out
            )[1]
            options.left_out = (
                options.left_out - {character.id} if ticked else options.left_out | {character.id}
            )
            workspace.remember(f"export {character.id}")
        imgui.end_child()
    _draw_range(workspace)
    imgui.same_line(0.0, 18.0)
    imgui.set_next_item_width(_FIELD_WIDTH)
    rate_index = FRAME_RATES.index(options.rate) if options.rate in FRAME_RATES else FRAME_RATES.index(30)
    options.rate = FRAME_RATES[
        imgui.combo("##rate", rate_index, [tr("{0} a second", rate) for rate in FRAME_RATES])[1]
    ]
    workspace.remember("export rate")
    draw_tooltip("Frames per second")
    if film:
        _draw_film_options(workspace)
    else:
        _draw_format_options(workspace)


def _draw_range(workspace: Workspace) -> None:
    """Draws the time range, with a button for the whole project and a button for the range between the in and
    out points.
    """
    options, editor = workspace.exporting, workspace.editor
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(tr("Seconds"))
    imgui.same_line(_LABEL_WIDTH)
    imgui.set_next_item_width(_FIELD_WIDTH - 30)
    options.first = imgui.drag_float("##first", options.first, 0.02, 0.0, editor.length, "%.2f")[1]
    workspace.remember("export first")
    imgui.same_line()
    imgui.text_unformatted(tr("to"))
    imgui.same_line()
    imgui.set_next_item_width(_FIELD_WIDTH - 30)
    last = options.last or editor.length
    changed, last = imgui.drag_float("##last", last, 0.02, 0.0, editor.length, "%.2f")
    options.last = last if changed else options.last
    workspace.remember("export last")
    imgui.same_line()
    if imgui.button(labelled(tr("All"), "All")):
        options.first, options.last = 0.0, 0.0
    workspace.remember("export all")
    imgui.same_line()
    imgui.begin_disabled(editor.marked_range is None)
    if imgui.button(labelled(tr("In to out"), "In to out")) and editor.marked_range is not None:
        options.first, options.last = editor.marked_range
    imgui.end_disabled()
    workspace.remember("export marked")
    draw_tooltip("Exports only the part between the in and out points (Alt+I, Alt+O)")


def _draw_film_options(workspace: Workspace) -> None:
    """Draws the size and the look of a film."""
    options = workspace.exporting
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(tr("Pixels"))
    imgui.same_line(_LABEL_WIDTH)
    imgui.set_next_item_width(_FIELD_WIDTH)
    size_index = FILM_SIZES.index(options.size) if options.size in FILM_SIZES else 1
    options.size = FILM_SIZES[imgui.combo("##size", size_index, list(FILM_SIZES))[1]]
    workspace.remember("export size")
    imgui.same_line(0.0, 18.0)
    imgui.text_unformatted(tr("Look"))
    imgui.same_line()
    imgui.set_next_item_width(_FIELD_WIDTH)
    looks: list[str] = list(LOOKS)
    size_index = looks.index(options.look or workspace.editor.look)
    changed, size_index = imgui.combo("##look", size_index, [tr(look) for look in looks])
    options.look = looks[size_index] if changed or options.look else ""
    workspace.remember("export look")


def _draw_format_options(workspace: Workspace) -> None:
    """Draws the options of the file formats."""
    options = workspace.exporting
    if any(character.is_solved for character in workspace.editor.project.characters.values()):
        options.morphs = imgui.checkbox(
            labelled(tr("Exact puppets (.glb)"), "Exact puppets (.glb)"), options.morphs
        )[1]
        workspace.remember("export morphs")
        draw_tooltip(
            "On: exact surfaces as morph targets, in a larger file. Off: the surfaces follow bones, "
            "which every program can play"
        )
        imgui.same_line(0.0, 18.0)
    supported = list_supported_options(workspace.export_suffix)
    imgui.begin_disabled(UNIT.name not in supported)
    centimetres = imgui.checkbox(labelled(tr("Centimetres"), "Centimetres (.bvh)"), options.unit == "cm")[1]
    options.unit = "cm" if centimetres else "m"
    imgui.end_disabled()
    workspace.remember("export centimetres")
    draw_tooltip("Many programs that read .bvh expect centimetres; a .glb is always in metres")
    _draw_placement_options(workspace, supported)
    draw_note(tr("The file extension determines the format: {0}.", ", ".join(EXPORT_SUFFIXES)))


def _draw_placement_options(workspace: Workspace, supported: frozenset[str]) -> None:
    """Draws the scale, the vertical axis, and the option to remove root motion. Options that the format lacks
    are grey.
    """
    options = workspace.exporting
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(tr("Scale"))
    imgui.same_line(_LABEL_WIDTH)
    imgui.set_next_item_width(_FIELD_WIDTH - 30)
    imgui.begin_disabled(SCALE.name not in supported)
    scale = imgui.drag_float("##scale", options.scale, 0.01, 1 / MAX_SCALE, MAX_SCALE, "%g", _SCALE_FLAGS)[1]
    options.scale = scale if 1 / MAX_SCALE <= scale <= MAX_SCALE else SCALE.default
    imgui.end_disabled()
    workspace.remember("export scale")
    draw_tooltip("Multiplies all lengths by this factor")
    imgui.same_line(0.0, 18.0)
    imgui.begin_disabled(UP.name not in supported)
    imgui.text_unformatted(tr("Vertical axis"))
    imgui.same_line()
    imgui.set_next_item_width(_AXIS_WIDTH)
    index = imgui.combo("##up axis", UP.choices.index(options.up), [axis.upper() for axis in UP.choices])[1]
    options.up = UP.choices[index]
    imgui.end_disabled()
    workspace.remember("export up")
    draw_tooltip("Vertical axis of the file. Some formats allow only one axis")
    imgui.same_line(0.0, 18.0)
    imgui.begin_disabled(IN_PLACE.name not in supported)
    options.in_place = imgui.checkbox(labelled(tr("In place"), "In place"), options.in_place)[1]
    imgui.end_disabled()
    workspace.remember("export in place")
    draw_tooltip("Removes the horizontal motion of each character's root")
