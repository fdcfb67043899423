"""The list of control points: select, rename, pair, weight and remove them, and set the symmetry."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from enliven.document import ControlPoint, ExampleCharacter, Project
from enliven.modeling.puppet.points import change_point
from enliven.modeling.puppet.poses import set_symmetry
from enliven.modeling.puppet.suggest import suggest_extremities, suggest_joint
from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import Change, draw_name_field, draw_slider, draw_switch, draw_tooltip
from enliven_viewer.studio.app.style import (
    draw_heading,
    draw_note,
    pack_colour,
    push_colours,
    use_small_text,
)
from enliven_viewer.studio.features.puppets.constraints import draw_constraint_buttons
from enliven_viewer.studio.features.puppets.performer_view import PerformerView
from enliven_viewer.studio.puppets.example_edits import turn_quarter, with_guessed_joints, with_points
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.puppets.symmetry import find_plane
from enliven_viewer.theme import ACCENT, INK, QUIET, RAISED, SHADOW, get_point_colour

_ROW_HEIGHT = 24.0
"""Height in pixels of a row in the list: a line of text with a margin."""
_FOOT_ICON, _LOCKED_ICON, _SOFT_ICON = "\uf063", "\uf023", "\uf09c"
"""Icons of Font Awesome 4: a foot, a hard point, a soft point."""
_SUGGESTION_COUNT = 6
"""Number of control points that are suggested at once, not counting mirror images."""
_AXIS_LABELS = (later("left to right"), later("top to bottom"), later("front to back"))


def draw_points(app: App, puppet: ExampleCharacter) -> None:
    """Draws the heading, a row per point, the fields of the selected point, and the buttons."""
    draw_heading(tr("Control points   {0}", len(puppet.points) or ""))
    if not puppet.points:
        _draw_orientation_buttons(app, puppet)
        draw_note(
            "Click the surface where you want to drag the puppet: hands, feet, head. Or press Suggest points."
        )
    for number, point in enumerate(puppet.points):
        _draw_row(app, puppet, number, point)
        if get_puppet_editor(app.editor).point == number:
            _draw_point_fields(app, puppet, point)
    _draw_buttons(app, puppet)
    _draw_symmetry(app, puppet)


def _draw_orientation_buttons(app: App, puppet: ExampleCharacter) -> None:
    """Draws the buttons that turn a mesh that lies on its back or faces sideways."""
    half = ImVec2((imgui.get_content_region_avail().x - 8) / 2, 0)
    for label, axis, tip in (
        (later("Stand it up"), "x", tr("Turns a mesh that lies on its back, so that it stands")),
        (
            later("Quarter turn"),
            "y",
            tr("Turns the mesh by 90 degrees. Repeat until it faces you in View > From the front (1)"),
        ),
    ):
        if imgui.button(labelled(tr(label), label), half):
            _turn_mesh(app, puppet.id, axis)
        app.remember(label.lower())
        draw_tooltip(tip)
        if axis == "x":
            imgui.same_line()


def _turn_mesh(app: App, puppet: str, axis: str) -> None:
    step = later("stand it up") if axis == "x" else later("quarter turn")
    if app.editor.edit(step, lambda project: turn_quarter(project, puppet, axis)):
        app.editor.frame_all(reset=False)


def _draw_row(app: App, puppet: ExampleCharacter, number: int, point: ControlPoint) -> None:
    """Draws one point: its mark as in the 3D view, its name, and its joint."""
    origin, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    puppets = get_puppet_editor(app.editor)
    if imgui.invisible_button(f"##point {number}", ImVec2(width, _ROW_HEIGHT - 4)):
        app.editor.select_only(puppet.id, None if puppets.point == number else number)
    app.remember(f"point {point.name}")
    hovered, chosen = imgui.is_item_hovered(), puppets.point == number
    draw_list = imgui.get_window_draw_list()
    if chosen or hovered:
        tint = pack_colour(ACCENT, 0.26) if chosen else pack_colour(RAISED)
        draw_list.add_rect_filled(origin, ImVec2(origin.x + width, origin.y + _ROW_HEIGHT - 4), tint, 5.0)
    middle = origin.y + (_ROW_HEIGHT - 4) / 2
    draw_list.add_circle_filled(ImVec2(origin.x + 11, middle), 5.5, _make_tint(number))
    draw_list.add_circle(ImVec2(origin.x + 11, middle), 5.5, pack_colour(SHADOW, 0.5), 0, 1.0)
    draw_list.add_text(ImVec2(origin.x + 24, origin.y + 2), pack_colour(INK), point.name)
    with use_small_text():
        joint_name = point.joint or tr("no joint yet")
        right = origin.x + width - 8 - imgui.calc_text_size(joint_name).x
        draw_list.add_text(
            ImVec2(right, origin.y + 4), pack_colour(QUIET if point.joint else ACCENT), joint_name
        )
        if point.foot:
            draw_list.add_text(ImVec2(right - 18, origin.y + 4), pack_colour(INK, 0.8), _FOOT_ICON)
        if point.weight is not None:
            draw_list.add_text(ImVec2(right - 34, origin.y + 4), pack_colour(QUIET), _SOFT_ICON)


def _draw_point_fields(app: App, puppet: ExampleCharacter, point: ControlPoint) -> None:
    """Draws the fields of the selected point."""
    editor, name = app.editor, point.name

    def change(step: str, **changes: object) -> bool:
        return editor.edit(step, lambda project: change_point(project, puppet.id, name, **changes))

    def edit(field: str, of: Callable[[float], object]) -> Change:
        return lambda project, value: change_point(project, puppet.id, name, **{field: of(value)})

    imgui.indent(22)
    draw_name_field(app, "point name", name, lambda to: change(later("rename a control point"), name=to))
    _draw_joint_list(app, puppet, point)
    draw_switch(
        app,
        "foot",
        point.foot,
        edit("foot", bool),
        "This control point is a foot: the puppet can stand and walk on it",
    )
    imgui.same_line()
    tip = tr("Pulls the surface towards this control point, but not necessarily all the way")
    draw_switch(app, "soft", point.weight is not None, edit("weight", lambda on: 1.0 if on else None), tip)
    imgui.same_line()
    if imgui.button(labelled(tr("Remove"), "Remove")):
        get_puppet_editor(editor).remove_point()
    app.remember("remove point")
    if point.weight is not None:
        draw_slider(app, "weight", point.weight, 0.01, 100.0, tr("pull %.2f"), edit("weight", float))
    draw_constraint_buttons(app, puppet)
    imgui.unindent(22)


def _draw_joint_list(app: App, puppet: ExampleCharacter, point: ControlPoint) -> None:
    """Draws the list of joints that the point may follow, most likely first."""
    editor, take = app.editor, app.state(PerformerView).take
    imgui.set_next_item_width(-1)
    if imgui.begin_combo("##joint", point.joint or tr("click or choose a joint")):
        clip = editor.project.takes.get(take or "")
        names = clip.skeleton.names if clip is not None else ()
        if clip is not None:
            best = suggest_joint(editor.project, puppet.id, str(take), point.name)
            if imgui.selectable(labelled(tr("{0}   likely", best), "likely"), best == point.joint)[0]:
                app.state(PerformerView).pair(best)
            imgui.separator()
        for joint in names:
            if imgui.selectable(f"{joint}###joint {joint}", joint == point.joint)[0]:
                app.state(PerformerView).pair(joint)
        imgui.end_combo()
    app.remember("joint")


def _draw_buttons(app: App, puppet: ExampleCharacter) -> None:
    editor = app.editor
    half = ImVec2((imgui.get_content_region_avail().x - 8) / 2, 0)
    if imgui.button(labelled(tr("Suggest points"), "Suggest points"), half):
        suggest_points(app, puppet)
    app.remember("suggest points")
    draw_tooltip("Puts control points at the ends of the limbs, and at their mirror images")
    imgui.same_line()
    take = app.state(PerformerView).take
    open_ones = [point.name for point in puppet.points if not point.joint]
    imgui.begin_disabled(take is None or not open_ones)
    if imgui.button(labelled(tr("Guess joints"), "Guess joints"), half):
        editor.edit("guess joints", lambda project: with_guessed_joints(project, puppet.id, str(take)))
    app.remember("guess joints")
    imgui.end_disabled()
    if imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
        imgui.set_tooltip(
            tr(
                "Pairs every control point without a joint with a joint at a similar place that moves in "
                "this take"
            )
        )


def suggest_points(app: App, puppet: ExampleCharacter) -> bool:
    """Adds control points at the ends of the mesh's limbs, as one edit."""

    def change(project: Project) -> Project:
        return with_points(project, puppet.id, suggest_extremities(puppet.mesh, _SUGGESTION_COUNT))

    return app.editor.edit("suggest control points", change)


def _draw_symmetry(app: App, puppet: ExampleCharacter) -> None:
    """Draws the symmetry options: mirrored examples, the plane, and editing both sides at once."""
    editor = app.editor
    toggled, is_symmetric = imgui.checkbox(
        labelled(tr("symmetric"), "symmetric"), puppet.symmetry is not None
    )
    app.remember("symmetric")
    draw_tooltip("Uses the mirror image of each key pose as well, so you need to pose only one side")
    if toggled:
        set_mirrored(app, puppet, is_symmetric)
        return
    if puppet.symmetry is None:
        return
    normal = [abs(value) for value in puppet.symmetry.normal]
    imgui.same_line()
    with use_small_text(), push_colours(QUIET, imgui.Col_.text):
        imgui.text_unformatted(tr(_AXIS_LABELS[normal.index(max(normal))]))
    toggled, is_symmetric = imgui.checkbox(
        labelled(tr("edit both sides at once"), "edit both sides at once"),
        get_puppet_editor(editor).symmetric,
    )
    app.remember("both sides")
    draw_tooltip("Puts and drags each control point together with its mirror image")
    if toggled:
        get_puppet_editor(editor).set_symmetric(is_symmetric)


def set_mirrored(app: App, puppet: ExampleCharacter, on: bool) -> None:
    """Sets or clears the symmetry plane of the examples.

    Before the first key pose, also switches symmetric editing.
    """
    editor = app.editor
    plane = find_plane(puppet) if on else None
    get_puppet_editor(editor).set_symmetric(on and not puppet.poses)
    if (plane is None) == (puppet.symmetry is None):
        if on:
            get_puppet_editor(editor).set_symmetric(True)  # This call reports a mesh without a mirror plane.
        return
    edit_name = later("symmetric") if plane else later("not symmetric")
    editor.edit(edit_name, lambda project: set_symmetry(project, puppet.id, plane))


def _make_tint(number: int) -> int:
    red, green, blue = get_point_colour(number)
    return pack_colour((red / 255, green / 255, blue / 255, 1.0))
