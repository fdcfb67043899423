"""Draws small images in the corners of the view: what the cameras see, and a limb from the side."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven.person import Body, Joint
from enliven.wire import CameraMessage
from enliven_viewer.language import tr
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.playback.document import find_bounds
from enliven_viewer.render.overlay.match_lines import find_limb_tints
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import draw_caption, pack_colour
from enliven_viewer.studio.features.perform.preview_placement import (
    DEFAULT_ASPECT,
    PreviewPlacement,
    ProjectedBody,
    find_aspect,
    find_rectangle,
    project_bodies,
)
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.viewport.preview_textures import PreviewTextures
from enliven_viewer.theme import DARK, INK, LINE, QUIET, UNTINTED, Colour, get_performer_colour

_LIMB_THICKNESS = 0.075
"""Thickness of a limb in metres. It is visible in an inset of a hundred pixels."""
_HEAD_RADIUS = 0.11
"""Radius of a head in metres."""
_MIN_OPACITY = 0.3
"""Opacity of body parts with confidence 0. Parts with confidence 1 are opaque."""
_TEXT_SIZE = 13.0
"""Text size in pixels in the inset."""


def draw_camera_previews(app: App, area: Area, inset: PreviewPlacement, pictures: PreviewTextures) -> None:
    """Draws the inset over the viewport, if it is enabled and performers are visible."""
    perform = app.state(PerformSession)
    views = list_views(perform) if app.preferences.performer else []
    app.widgets.pop("performer inset", None)
    if not views:
        return
    available_size = area.width, area.height
    widths = [find_aspect(view.camera) for view in views]
    left, top, wide, height = inset.place(
        *available_size, sum(widths) / DEFAULT_ASPECT, lambda: _find_covered_rectangles(app)
    )
    draw_list, x = imgui.get_background_draw_list(), area.x + left
    for view, width in zip(views, widths, strict=True):
        _draw_view(
            draw_list,
            Area(x, area.y + top, width * height, height),
            view,
            pictures.get_texture(view.name, view.camera),
        )
        x += width * height
    app.widgets["performer inset"] = (
        *(area.x + left, area.y + top),
        *(area.x + left + wide, area.y + top + height),
    )
    _draw_tooltip(app, Area(area.x + left, area.y + top, wide, height))


@dataclass(frozen=True)
class PreviewContent:
    """The contents of one camera view of an edge or a take: the name, the performers, and the camera.

    ``limbs`` contains the sRGB colours of matched bones, by performer and by the joint at the bone's end.
    """

    name: str
    bodies: tuple[Body, ...]
    camera: CameraMessage | None = None
    limbs: Mapping[int, Mapping[int, tuple[float, float, float]]] = field(default_factory=dict)


def list_views(perform: PerformSession) -> list[PreviewContent]:
    """Returns the camera views of all edges, or of the take, or an empty result without a connection."""
    live = perform.live
    if live is None or not (live.take or perform.connected):
        return []
    views = [_make_view(live.take or tr("Performer"), live, perform.camera)]
    guests = [guest for guest in perform.secondary_edges if guest.connected]
    views += [_make_view(guest.name, guest.live, guest.camera) for guest in guests]
    someone = any(view.bodies for view in views)
    return views if someone or perform.active_workspace == "Perform" else []


def _make_view(name: str, live: LiveStage, camera: CameraMessage | None) -> PreviewContent:
    return PreviewContent(name, live.scene.bodies, camera, find_limb_tints(live.scene.boards))


def _find_covered_rectangles(app: App) -> list[tuple[float, float, float, float]]:
    """Returns the rectangles covered by live characters and by those of the project."""
    editor, rectangles = app.editor, []
    lens, project_bounds = (
        editor.lens,
        find_bounds([character.extent for character in editor.visible_characters]),
    )
    for box in (editor.live_box, project_bounds):
        if box is not None:
            corners = np.array(list(itertools.product(*zip(*box, strict=True))))
            rectangles.append(find_rectangle(lens.project(corners)[0]))
    return [rectangle for rectangle in rectangles if rectangle is not None]


def _draw_view(draw_list: imgui.ImDrawList, area: Area, view: PreviewContent, texture: int | None) -> None:
    """Draws one camera's image."""
    name, bodies = view.name, project_bodies(view.bodies, view.camera)
    low, high = ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height)
    draw_list.add_rect_filled(low, high, pack_colour((*DARK[:3], 0.86)), 8.0)
    if texture is not None:
        picture, white = imgui.ImTextureRef(texture), pack_colour(UNTINTED)
        draw_list.add_image_rounded(picture, low, high, ImVec2(0, 0), ImVec2(1, 1), white, 8.0)
    draw_list.push_clip_rect(low, high, True)
    for number, body in enumerate(bodies):
        limbs = view.limbs.get(body.id, {})
        _draw_figure(draw_list, area, body, get_performer_colour(number), find_aspect(view.camera), limbs)
    label = name if bodies else tr("{0}: no one in view", name)
    draw_caption(draw_list, ImVec2(area.x + 9, area.y + 6), label, INK if bodies else QUIET, _TEXT_SIZE)
    draw_list.pop_clip_rect()
    draw_list.add_rect(low, high, pack_colour(LINE), 8.0, 1.5)


def _draw_figure(
    draw_list: imgui.ImDrawList,
    area: Area,
    body: ProjectedBody,
    tint: Colour,
    width: float,
    limbs: Mapping[int, tuple[float, float, float]],
) -> None:
    """Draws a performer: a head and limbs. Farther limbs are drawn first and are darker.

    `width` is the aspect ratio.
    """
    joint_pixels = body.places * area.height + [area.x, area.y]
    joint_pixels[:, 0] += (area.width - width * area.height) / 2
    if not np.isfinite(joint_pixels).all():
        return
    far, near = float(body.depth.max()), float(body.depth.min())
    for parent, joint in body.bones:
        red, green, blue = limbs.get(joint, tint[:3])
        depth = float(body.depth[[parent, joint]].mean())
        light = 1.0 - 0.45 * (depth - near) / max(far - near, 0.3)
        sure = _MIN_OPACITY + (1.0 - _MIN_OPACITY) * float(
            min(body.confidence[parent], body.confidence[joint])
        )
        ink = pack_colour((light * red, light * green, light * blue, sure))
        thick = max(area.height * body.pixels(_LIMB_THICKNESS, joint), 2.0)
        draw_list.add_line(ImVec2(*joint_pixels[parent]), ImVec2(*joint_pixels[joint]), ink, thick)
        draw_list.add_circle_filled(ImVec2(*joint_pixels[joint]), thick / 2, ink)
    head = int(Joint.HEAD)
    head_tint = (*limbs.get(head, tint[:3]), 1.0)
    draw_list.add_circle_filled(
        ImVec2(*joint_pixels[head]), area.height * body.pixels(_HEAD_RADIUS, head), pack_colour(head_tint)
    )


def _draw_tooltip(app: App, area: Area) -> None:
    """Shows a tooltip with the shortcut that hides the inset while the pointer is over it."""
    io = imgui.get_io()
    if area.contains(io.mouse_pos.x, io.mouse_pos.y) and not io.want_capture_mouse and not io.mouse_down[0]:
        imgui.set_tooltip(app.actions.make_tooltip(app.actions["view.performer"]))


_SIDE_VIEW_HEIGHT_FRACTION = 0.3
"""Height as a fraction of the view's height."""
_SIDE_VIEW_MIN_HEIGHT = 104.0
"""Minimum height in pixels, so that the limb is recognisable."""
_SIDE_VIEW_MAX_HEIGHT = 400.0
"""Maximum height in pixels. A larger image shows no more detail."""
_SIDE_VIEW_ASPECT = 1.2
"""Aspect ratio, equal to that of the camera preview in another corner."""
_SIDE_VIEW_MARGIN = 14.0
"""Distance in pixels from the border of the view."""
_SIDE_VIEW_TEXT_SIZE = 13.0
"""Text size of its title in pixels."""


def find_side_view_area(app: App, area: Area) -> Area:
    """Returns the area of the side view in the window: at the top right, or below a camera preview there."""
    height = min(
        max(_SIDE_VIEW_HEIGHT_FRACTION * area.height, _SIDE_VIEW_MIN_HEIGHT),
        _SIDE_VIEW_MAX_HEIGHT,
        max(area.height / 2 - _SIDE_VIEW_MARGIN, 1.0),
    )
    width, top = _SIDE_VIEW_ASPECT * height, area.y + _SIDE_VIEW_MARGIN
    left = area.x + area.width - width - _SIDE_VIEW_MARGIN
    inset = app.widgets.get("performer inset")
    if inset is not None and inset[2] > left and inset[1] < top + height:
        top = inset[3] + _SIDE_VIEW_MARGIN
    return Area(left, top, width, height)


def draw_side_view(app: App, area: Area, texture: int) -> None:
    """Draws the side view that the window has rendered."""
    draw_list, place = imgui.get_background_draw_list(), find_side_view_area(app, area)
    low, high = ImVec2(place.x, place.y), ImVec2(place.x + place.width, place.y + place.height)
    white = pack_colour(UNTINTED)
    draw_list.add_image_rounded(
        imgui.ImTextureRef(texture), low, high, ImVec2(0, 1), ImVec2(1, 0), white, 8.0
    )
    draw_list.add_rect(low, high, pack_colour(LINE), 8.0, 1.5)
    draw_caption(draw_list, ImVec2(place.x + 9, place.y + 6), tr("From the side"), INK, _SIDE_VIEW_TEXT_SIZE)
    app.widgets["side view"] = (low.x, low.y, high.x, high.y)
