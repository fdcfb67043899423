"""Draws the numbers of the selection: position, size, rotation, and the start of its motion."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui

from enliven.modeling.edits import change_layers
from enliven_viewer.language import tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.quantity import ANGLE, LENGTH, TIME, Quantity
from enliven_viewer.studio.app.style import push_colours, use_small_text
from enliven_viewer.theme import QUIET

_AXES = ("x", "y", "z")
_LABEL_WIDTH = 46.0
"""Width in pixels of the labels at the left of the fields."""
_FIELD_WIDTH = 67.0
"""Width of a field in pixels. It fits "-12.345 m", and three fields fit side by side."""


def draw_transform_fields(app: App) -> None:
    """Draws the fields of the selection."""
    figures = app.selection_transform
    place, height = figures.place, figures.height
    if place is None or height is None:
        return
    _draw_label(
        tr("Place"),
        tr("Position of the chosen shapes: x and z of their centre, and the height y of their lowest point"),
    )
    for axis, name in enumerate(_AXES):
        imgui.same_line(_LABEL_WIDTH + 12 + axis * (_FIELD_WIDTH + 4))
        coordinate = float(place[axis])
        draw_number_field(
            app, f"place {name}", coordinate, LENGTH, lambda to, axis=axis: figures.move_to(axis, to)
        )
    _draw_label(tr("Turn"), tr("Turns the chosen shapes about an axis of the stage. The y axis points up"))
    for axis, name in enumerate(_AXES):
        imgui.same_line(_LABEL_WIDTH + 12 + axis * (_FIELD_WIDTH + 4))
        draw_number_field(app, f"turn {name}", 0.0, ANGLE, lambda by, axis=axis: figures.turn(axis, by))
    _draw_label(
        tr("Height"), tr("Height of the chosen shapes. You can also type a percentage, such as 150 %")
    )
    imgui.same_line(_LABEL_WIDTH + 12)
    units = {"percent": height / 100.0}
    draw_number_field(app, "tall", height, LENGTH, figures.set_height, **units)
    _draw_start_time(app)


def _draw_start_time(app: App) -> None:
    """Draws the start time of the selected layer."""
    editor = app.editor
    character, number = editor.find_selected(), editor.selection.layer
    if character is None or number is None or editor.selection.has_several:
        return
    name, numbers = character.id, [number]

    def change(seconds: float) -> None:
        editor.edit("change offset", lambda project: change_layers(project, name, numbers, offset=seconds))

    imgui.same_line()
    _draw_label(tr("Begins"), tr("Time on the timeline at which the chosen motion begins"))
    imgui.same_line()
    draw_number_field(app, "begins", character.playing[number].offset, TIME, change)


def _draw_label(text: str, tip: str) -> None:
    imgui.align_text_to_frame_padding()
    with use_small_text(), push_colours(QUIET, imgui.Col_.text):
        imgui.text_unformatted(text)
    draw_tooltip(tip)


def draw_number_field(
    app: App,
    key: str,
    value: float,
    quantity: Quantity,
    change: Callable[[float], object],
    **more: float,
) -> None:
    """Draws a numeric field with units and arithmetic.

    ``change`` gets the value on Enter, Tab, or a click elsewhere.

    Args:
        more: further accepted units, with their factors.
    """
    shown, typing = quantity.format_value(value), app.typing
    imgui.set_next_item_width(_FIELD_WIDTH)
    flags = imgui.InputTextFlags_.auto_select_all
    with use_small_text():
        typed = imgui.input_text(f"##{key}", typing.get(key, shown), flags)[1]
    app.remember(key)
    if imgui.is_item_active():
        typing[key] = typed
    elif key in typing:
        typed_text = typing.pop(key)
        if typed_text.strip() not in ("", shown):
            app.run_and_report(lambda: change(quantity.parse_value(typed_text, **more)))
