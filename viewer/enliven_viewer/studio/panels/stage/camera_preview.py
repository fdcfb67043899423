"""Draws the performers as seen by their cameras, in a corner of the view, one image per edge."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven.person import Body, Joint
from enliven.wire import CameraMessage
from enliven_viewer.language import tr
from enliven_viewer.live import LiveStage
from enliven_viewer.playback import bounds_of
from enliven_viewer.render.overlay import limb_tints
from enliven_viewer.studio.panel_layout import Area
from enliven_viewer.studio.panels.style import caption, packed
from enliven_viewer.studio.perform import (
    WIDER,
    PerformSession,
    PreviewPlacement,
    ProjectedBody,
    project_bodies,
    rectangle_of,
    width_of,
)
from enliven_viewer.studio.picture import PreviewTextures
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import DARK, INK, LINE, QUIET, UNTINTED, Colour, performer_colour

_LIMB_THICKNESS = 0.075
"""Thickness of a limb in metres, visible in an inset of a hundred pixels."""
_HEAD_RADIUS = 0.11
"""Radius of a head in metres."""
_MIN_OPACITY = 0.3
"""Opacity of body parts with confidence 0. Parts with confidence 1 are opaque."""
_TEXT_SIZE = 13.0
"""Text size in pixels in the inset."""


def draw_camera_previews(
    workspace: Workspace, area: Area, inset: PreviewPlacement, pictures: PreviewTextures
) -> None:
    """Draws the inset over the viewport, if it is enabled and performers are visible."""
    perform = workspace.perform
    views = views_of(perform) if workspace.preferences.performer else []
    workspace.widgets.pop("performer inset", None)
    if not views:
        return
    room = area.width, area.height
    widths = [width_of(view.camera) for view in views]
    left, top, wide, tall = inset.place(*room, sum(widths) / WIDER, lambda: _covered_rectangles(workspace))
    draw, x = imgui.get_background_draw_list(), area.x + left
    for view, width in zip(views, widths, strict=True):
        _view(draw, Area(x, area.y + top, width * tall, tall), view, pictures.of(view.name, view.camera))
        x += width * tall
    workspace.widgets["performer inset"] = (
        *(area.x + left, area.y + top),
        *(area.x + left + wide, area.y + top + tall),
    )
    _explain(workspace, Area(area.x + left, area.y + top, wide, tall))


@dataclass(frozen=True)
class PreviewContent:
    """The image of an edge's camera, live or in a take: the name, the performers, and the camera.

    ``limbs`` are the colours of a match, sRGB by performer and by the outer joint of a bone.
    """

    name: str
    bodies: tuple[Body, ...]
    camera: CameraMessage | None = None
    limbs: Mapping[int, Mapping[int, tuple[float, float, float]]] = field(default_factory=dict)


def views_of(perform: PerformSession) -> list[PreviewContent]:
    """Returns the camera views of all edges, or that of the take; empty without a link."""
    live = perform.live
    if live is None or not (live.take or perform.connected):
        return []
    views = [_view_of(live.take or tr("Performer"), live, perform.camera)]
    guests = [guest for guest in perform.secondary_edges if guest.connected]
    views += [_view_of(guest.name, guest.live, guest.camera) for guest in guests]
    someone = any(view.bodies for view in views)
    return views if someone or perform.active_workspace == "Perform" else []


def _view_of(name: str, live: LiveStage, camera: CameraMessage | None) -> PreviewContent:
    return PreviewContent(name, live.scene.bodies, camera, limb_tints(live.scene.boards))


def _covered_rectangles(workspace: Workspace) -> list[tuple[float, float, float, float]]:
    """Returns the rectangles covered by live characters and by those of the project."""
    editor, rectangles = workspace.editor, []
    lens, own = editor.lens, bounds_of([character.extent for character in editor.visible_characters])
    for box in (editor.beside_box, own):
        if box is not None:
            corners = np.array(list(itertools.product(*zip(*box, strict=True))))
            rectangles.append(rectangle_of(lens.project(corners)[0]))
    return [rectangle for rectangle in rectangles if rectangle is not None]


def _view(draw: imgui.ImDrawList, area: Area, view: PreviewContent, texture: int | None) -> None:
    """Draws one camera's image."""
    name, bodies = view.name, project_bodies(view.bodies, view.camera)
    low, high = ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height)
    draw.add_rect_filled(low, high, packed((*DARK[:3], 0.86)), 8.0)
    if texture is not None:
        picture, white = imgui.ImTextureRef(texture), packed(UNTINTED)
        draw.add_image_rounded(picture, low, high, ImVec2(0, 0), ImVec2(1, 1), white, 8.0)
    draw.push_clip_rect(low, high, True)
    for number, body in enumerate(bodies):
        limbs = view.limbs.get(body.id, {})
        _figure(draw, area, body, performer_colour(number), width_of(view.camera), limbs)
    label = name if bodies else tr("{0}: no one in view", name)
    caption(draw, ImVec2(area.x + 9, area.y + 6), label, INK if bodies else QUIET, _TEXT_SIZE)
    draw.pop_clip_rect()
    draw.add_rect(low, high, packed(LINE), 8.0, 1.5)


def _figure(
    draw: imgui.ImDrawList,
    area: Area,
    body: ProjectedBody,
    tint: Colour,
    width: float,
    limbs: Mapping[int, tuple[float, float, float]],
) -> None:
    """Draws a performer: limbs with the farther ones first and darker, and a head.

    `width` is the aspect ratio.
    """
    at = body.places * area.height + [area.x, area.y]
    at[:, 0] += (area.width - width * area.height) / 2
    if not np.isfinite(at).all():
        return
    far, near = float(body.depth.max()), float(body.depth.min())
    for parent, joint in body.bones:
        red, green, blue = limbs.get(joint, tint[:3])
        depth = float(body.depth[[parent, joint]].mean())
        light = 1.0 - 0.45 * (depth - near) / max(far - near, 0.3)
        sure = _MIN_OPACITY + (1.0 - _MIN_OPACITY) * float(
            min(body.confidence[parent], body.confidence[joint])
        )
        ink = packed((light * red, light * green, light * blue, sure))
        thick = max(area.height * body.pixels(_LIMB_THICKNESS, joint), 2.0)
        draw.add_line(ImVec2(*at[parent]), ImVec2(*at[joint]), ink, thick)
        draw.add_circle_filled(ImVec2(*at[joint]), thick / 2, ink)
    head = int(Joint.HEAD)
    head_tint = (*limbs.get(head, tint[:3]), 1.0)
    draw.add_circle_filled(
        ImVec2(*at[head]), area.height * body.pixels(_HEAD_RADIUS, head), packed(head_tint)
    )


def _explain(workspace: Workspace, area: Area) -> None:
    """Shows a tooltip with the shortcut that hides the inset while the pointer is over it."""
    io = imgui.get_io()
    if area.holds(io.mouse_pos.x, io.mouse_pos.y) and not io.want_capture_mouse and not io.mouse_down[0]:
        imgui.set_tooltip(workspace.actions.tip(workspace.actions["view.performer"]))
