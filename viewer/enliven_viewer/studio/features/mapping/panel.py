"""The source view: a take's skeleton next to the shapes, and thumbnails of the parts that it could drive."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven.mapping.plan import Plan
from enliven.mapping.quality import (
    MAX_FLOOR_DISTANCE,
    MAX_INTERSECTION,
    MAX_SLIDE_CM_S,
    MAX_STRETCH,
    MotionQuality,
)
from enliven.mapping.softening import limb_name
from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import (
    FIXED_WINDOW_FLAGS,
    draw_heading,
    draw_note,
    open_panel,
    pack_colour,
    use_small_text,
)
from enliven_viewer.studio.features.mapping.map_tool import MapTool
from enliven_viewer.studio.features.mapping.motion_matches import MotionMatch
from enliven_viewer.theme import ACCENT, CHAIN, DARK, QUIET, UNTINTED

_BUTTONS_HEIGHT = 34.0
"""Height in pixels of the row of buttons below the view."""
_QUALITY_HEIGHT = 4 * 20.0
"""Height in pixels of the lines about the quality of a motion."""
_THUMBNAIL_SIZE = ImVec2(92, 92)


def draw_source(app: App, tool: MapTool, area: Area, texture: int | None) -> None:
    """Draws the source view. ``texture`` is the OpenGL name of the rendered take."""
    with open_panel("source", area, imgui.WindowFlags_.no_scrollbar):
        draw_heading("Source")
        _draw_takes(app, tool)
        size = imgui.get_content_region_avail()
        tool.source.size = (
            max(size.x, 1.0),
            max(size.y - _BUTTONS_HEIGHT - (_QUALITY_HEIGHT if tool.last_mapping else 0.0), 1.0),
        )
        _draw_picture(app, tool, texture)
        _, tool.loop = imgui.checkbox(labelled(tr("loop"), "loop"), tool.loop)
        app.remember("loop")
        imgui.same_line()
        if imgui.button(labelled(tr("Matches"), "Matches")):
            tool.rank()
        app.remember("find matches")
        draw_tooltip("Finds the limbs of the chosen shape that are most similar to the take's current pose")
        imgui.same_line()
        if imgui.button(labelled(tr("Whole body"), "Whole body"), ImVec2(-34, 0)):
            tool.map_whole()
        app.remember("whole body")
        draw_tooltip("Maps all limbs of the take to limbs of the chosen shape in one step")
        _draw_options(app, tool)
        if tool.last_mapping is not None:
            with use_small_text():
                for line in list_quality_lines(*tool.last_mapping[2:]):
                    draw_note(line)


_WHOLE_BODY_OPTIONS = (
    ("floor", later("On the floor"), later("Keeps the lowest point of a standing shape on the floor")),
    (
        "steps",
        later("Steps"),
        later(
            "The shape's feet step where the performer's feet step, even if its legs have other proportions"
        ),
    ),
    ("travel", later("Travels"), later("The shape moves through the scene with the performer")),
    ("pin", later("Hold feet"), later("Feet do not slide while they are on the floor")),
    (
        "stretch",
        later("Stretch bones"),
        later("The shape's bones stretch as much as the take's bones, relative to the shape's size"),
    ),
    (
        "limits",
        later("Joint limits"),
        later(
            "For a model that is not a person: joints stay near the range of motion in the model's own clips"
        ),
    ),
)
"""Options of whole-body retargeting: the setting, its label, and its effect."""


def _draw_options(app: App, tool: MapTool) -> None:
    """Draws the button that opens the options of whole-body retargeting."""
    imgui.same_line()
    if imgui.button("\uf013##how", ImVec2(-1, 0)):
        imgui.open_popup("whole body how")
    app.remember("whole how")
    draw_tooltip("Options of “Whole body”: floor, steps, travel")
    if not imgui.begin_popup("whole body how"):
        return
    for name, label, description in _WHOLE_BODY_OPTIONS:
        is_on = imgui.checkbox(f"{tr(label)}###{name}", getattr(tool.whole_body, name))[1]
        setattr(tool.whole_body, name, is_on)
        app.remember(f"whole {name}")
        draw_tooltip(description)
    _, tool.gentle = imgui.checkbox(
        labelled(
            tr("Move limbs less where the surface would stretch"),
            "Move limbs less where the surface would stretch",
        ),
        tool.gentle,
    )
    app.remember("whole gentle")
    draw_tooltip(
        "Reduces the motion of left and right limbs equally, until the surface stretches only a little"
    )
    imgui.end_popup()


def list_quality_lines(plan: Plan, quality: MotionQuality) -> list[str]:
    """Returns the quality of a retargeted motion, line by line."""
    worst = ", ".join(limb.limb for limb in quality.worst_limbs[:2])
    if not quality.worst_limbs:
        pose_line = tr("Limb directions match the performer's")
    else:
        pose_line = tr("Limb directions differ from the performer's: {0}", worst)
    lines = [pose_line] if quality.limbs else []
    if quality.stretch > MAX_STRETCH:
        lines.append(tr("The surface stretches too much, at {0}", ", ".join(quality.joints[:2])))
    else:
        lines.append(tr("The surface stretches little"))
    floor = []
    if quality.sunk is not None and max(quality.sunk, quality.afloat or 0.0) > MAX_FLOOR_DISTANCE:
        floor.append(tr("the shape sinks into the floor or floats above it"))
    if quality.slide is not None and quality.slide > MAX_SLIDE_CM_S:
        floor.append(tr("feet slide"))
    if quality.through > MAX_INTERSECTION:
        floor.append(tr("the surface passes through itself: {0}", ", ".join(quality.parts[:2])))
    less = {limb_name(c): c.weight for c in plan.chains if c.weight < 1.0 and "whole" not in c.role}
    told_less = ", ".join(f"{limb} {weight:.0%}" for limb, weight in less.items())
    return [
        *lines,
        *([", ".join(floor)] if floor else []),
        *([tr("Moved less: {0}", told_less)] if less else []),
    ]


def _draw_takes(app: App, tool: MapTool) -> None:
    takes = app.editor.project.takes
    imgui.set_next_item_width(-1)
    if imgui.begin_combo("##take", tool.source.take or tr("choose a take")):
        for name in takes:
            if imgui.selectable(f"{name}###take {name}", name == tool.source.take)[0]:
                tool.source.show(name)
            app.remember(f"pick {name}")
        imgui.end_combo()
    app.remember("takes")
    if not takes:
        draw_note("No takes yet. Open a BVH file, or an animated model.")


def _draw_picture(app: App, tool: MapTool, texture: int | None) -> None:
    source, origin = tool.source, imgui.get_cursor_screen_pos()
    size = ImVec2(*source.size)
    imgui.invisible_button("##source", size)
    app.remember("source")
    draw_list = imgui.get_window_draw_list()
    corner = ImVec2(origin.x + size.x, origin.y + size.y)
    if texture is not None and source.clip is not None:
        draw_list.add_image_rounded(
            imgui.ImTextureRef(texture),
            origin,
            corner,
            ImVec2(0, 1),
            ImVec2(1, 0),
            pack_colour(UNTINTED),
            6.0,
        )
    else:
        draw_list.add_rect_filled(origin, corner, pack_colour(DARK), 6.0)
    with use_small_text():
        caption_text = (
            tr("{0} bones chosen", len(source.chain) - 1) if len(source.chain) > 1 else tr("click a chain")
        )
        draw_list.add_text(
            ImVec2(origin.x + 8, origin.y + 6), pack_colour(CHAIN if source.chain else QUIET), caption_text
        )
    pointer = imgui.get_mouse_pos()
    place = (pointer.x - origin.x, pointer.y - origin.y)
    if imgui.is_item_activated():
        source.press(place)
    if imgui.is_item_hovered() or imgui.is_item_active():
        source.move(place)
        wheel = imgui.get_io().mouse_wheel
        if wheel:
            source.camera.zoom(0.88**wheel)
    if imgui.is_item_deactivated():
        source.release()


def draw_matches(app: App, tool: MapTool, viewport: Area) -> None:
    """Draws thumbnails of the matches along the top, best first. A click accepts the highlighted one."""
    width = len(tool.offered) * (_THUMBNAIL_SIZE.x + 8) + 24
    imgui.set_next_window_pos(ImVec2(viewport.x + 14, viewport.y + 56))
    imgui.set_next_window_size(ImVec2(width, _THUMBNAIL_SIZE.y + 46))
    imgui.begin("matches", None, FIXED_WINDOW_FLAGS | imgui.WindowFlags_.no_scrollbar)
    draw_note("Matches, the best first. Click a match to accept it.")
    tool.highlighted = tool.offered[0]
    chosen: MotionMatch | None = None
    for number, offer in enumerate(tool.offered):
        if number:
            imgui.same_line()
        position = imgui.get_cursor_screen_pos()
        if imgui.invisible_button(f"##match {number}", _THUMBNAIL_SIZE):
            chosen = offer
        app.remember(f"match {number}")
        if imgui.is_item_hovered():
            tool.highlighted = offer
        _draw_thumbnail(app, offer, position, tool.highlighted is offer)
    imgui.end()
    if chosen is not None:
        tool.accept(chosen)
        tool.offered, tool.highlighted = [], None


def _draw_thumbnail(app: App, offer: MotionMatch, corner_position: ImVec2, is_highlighted: bool) -> None:
    """Draws the shape's bones from the current viewing direction, with the driven bones in colour."""
    draw_list = imgui.get_window_draw_list()
    corner = ImVec2(corner_position.x + _THUMBNAIL_SIZE.x, corner_position.y + _THUMBNAIL_SIZE.y)
    draw_list.add_rect_filled(corner_position, corner, pack_colour(DARK), 6.0)
    if is_highlighted:
        draw_list.add_rect(corner_position, corner, pack_colour(ACCENT), 6.0, 1.5)
    posed = app.editor.stage_character(offer.shape)
    pixels = app.editor.lens.project(posed.handles)[0]
    low, high = np.nanmin(pixels, axis=0), np.nanmax(pixels, axis=0)
    scale = (_THUMBNAIL_SIZE.x - 26) / max(float((high - low).max()), 1.0)
    places = (pixels - (low + high) / 2) * scale + [
        corner_position.x + _THUMBNAIL_SIZE.x / 2,
        corner_position.y + _THUMBNAIL_SIZE.y / 2 + 5,
    ]
    driven = {b for _, chain in offer.pairs for b in chain[1:]}
    for parent, joint in posed.bones:
        a, b = ImVec2(*places[parent]), ImVec2(*places[joint])
        is_driven = joint in driven
        draw_list.add_line(
            a,
            b,
            pack_colour(CHAIN if is_driven else QUIET, 1.0 if is_driven else 0.55),
            2.4 if is_driven else 1.2,
        )
