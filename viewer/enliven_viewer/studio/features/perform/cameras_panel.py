"""Draws the cameras of this machine and the edges on the network, with buttons that connect to them."""

from __future__ import annotations

from functools import partial

import moderngl
from imgui_bundle import ImVec2, imgui

from enliven.arrays import UInt8
from enliven.peers.edge_browser import DiscoveredEdge
from enliven.wire import CameraMessage
from enliven_viewer.language import labelled, tr, tr_n
from enliven_viewer.link.edge_search import EdgeSearch
from enliven_viewer.render.gl.context import get_window_context
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import (
    draw_heading,
    draw_note,
    open_list_box,
    pack_colour,
    push_colours,
    use_small_text,
)
from enliven_viewer.studio.features.perform.cameras import Camera, CameraSearch
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.viewport.preview_textures import PreviewTextures
from enliven_viewer.theme import DARK, QUIET, WAIT

_EYE_ICON = "\uf06e"
"""Icon of Font Awesome 4: an eye."""
_TEST_BUTTON_WIDTH = 42.0
"""Width in pixels of the test image button at the right of a camera's button."""
_LIST_HEIGHT = 108.0
"""Height in pixels of the list. It fits three cameras, or one camera and its problem."""
_TEST_IMAGE_SIZE = (320.0, 240.0)
"""Maximum width and height in pixels of a displayed test image."""
_GAP = 8.0
"""Distance in pixels between a test image and the panel."""
_TEST_IMAGE_TOP = 60.0
"""Distance in pixels from the top of the panel to the top of a test image, which is next to the list."""
_CAPTION_HEIGHT = 40.0
"""Height in pixels of the text below a test image: two lines."""
_POPUP_ID = "look"
"""The name of the popup with a test image."""


class _TestImage:
    """The texture of the last test image."""

    texture: moderngl.Texture | None = None
    number = 0


def draw_cameras(app: App, area: Area) -> None:
    """Draws the list of cameras. The first call starts the search.

    The list has the same height before, during and after the search, so that nothing below it moves.
    """
    search = app.state(PerformSession).cameras
    if search.cameras is None and not search.is_searching:
        search.begin()
    search.poll()
    draw_heading("Cameras here")
    looks = False
    with open_list_box("cameras", _LIST_HEIGHT) as available_width:
        if search.problem:
            draw_note(search.problem)
        for number, camera in enumerate(search.cameras or ()):
            looks |= _draw_camera(app, search, camera, number, available_width)
        if not search.cameras and not search.problem:
            draw_note(
                "Searching ..."
                if search.is_searching
                else "No camera is plugged in. Plug in a camera, and press Search again."
            )
    app.remember("cameras")
    imgui.begin_disabled(search.is_searching)
    if imgui.button(
        labelled(tr("Searching for cameras ..."), "search")
        if search.is_searching
        else labelled(tr("Search again"), "search"),
        ImVec2(-1, 0),
    ):
        search.begin()
    imgui.end_disabled()
    app.remember("look for cameras")
    if looks:
        imgui.open_popup(_POPUP_ID)
    _draw_test_image(app, search, area)


def _draw_camera(app: App, search: CameraSearch, camera: Camera, number: int, available_width: float) -> bool:
    """Draws a camera: the start button, the test image button, and its problem.

    The row is ``available_width`` pixels wide.

    Returns:
        True if a test image was requested.
    """
    looks = False
    imgui.begin_disabled(not camera.can_start)
    test_button_width = _TEST_BUTTON_WIDTH if camera.depth and camera.can_start else 0.0
    if imgui.button(
        f"{shorten_text(camera.title, available_width - test_button_width - 16)}###camera {number}",
        ImVec2(available_width - test_button_width, 0),
    ):
        search.close()  # End a running camera test, because it blocks the camera for the edge.
        app.run_and_report(lambda: app.state(PerformSession).connect_local(*camera.words))
    imgui.end_disabled()
    app.remember(f"camera {number}")
    draw_tooltip(
        tr("Starts a stage with this camera: {0}", camera.title) if camera.can_start else camera.title
    )
    if test_button_width:
        imgui.same_line()
        imgui.begin_disabled(search.tested_camera is not None)
        if imgui.button(
            f"{_EYE_ICON}##look {number}", ImVec2(_TEST_BUTTON_WIDTH - imgui.get_style().item_spacing.x, 0)
        ):
            search.take_test_image(camera)
            looks = True
        imgui.end_disabled()
        app.remember(f"look {number}")
        draw_tooltip("Shows a test picture of this camera")
    if camera.trouble:
        with push_colours(WAIT, imgui.Col_.text):
            imgui.push_text_wrap_pos(0.0)
            imgui.text_unformatted(f"{camera.trouble[:1].upper()}{camera.trouble[1:]}.")
            imgui.pop_text_wrap_pos()
        draw_note(camera.remedy)
    elif camera.hint:
        draw_note(f"{camera.hint[:1].upper()}{camera.hint[1:]}")
    return looks


def _draw_test_image(app: App, search: CameraSearch, area: Area) -> None:
    """Draws a camera's last test image in a popup next to the panel.

    The popup has the same size while it waits for the image.
    """
    width = _TEST_IMAGE_SIZE[0] + 2 * imgui.get_style().window_padding.x
    imgui.set_next_window_pos(ImVec2(area.x - _GAP - width, area.y + _TEST_IMAGE_TOP))
    if not imgui.begin_popup(_POPUP_ID):
        return
    camera = search.tested_camera or (search.test_result[0] if search.test_result is not None else None)
    max_size = ImVec2(*_TEST_IMAGE_SIZE)
    imgui.text_unformatted(shorten_text(camera.title if camera is not None else "", max_size.x))
    position = imgui.get_cursor_screen_pos()
    imgui.dummy(max_size)
    app.remember("camera view")
    if search.tested_camera is None and search.picture is not None:
        texture = _get_texture(search.picture, search.number)
        high, width = search.picture.shape[:2]
        scale = min(max_size.x / width, max_size.y / high)
        low = ImVec2(
            position.x + (max_size.x - scale * width) / 2, position.y + (max_size.y - scale * high) / 2
        )
        far = ImVec2(low.x + scale * width, low.y + scale * high)
        imgui.get_window_draw_list().add_image(imgui.ImTextureRef(texture.glo), low, far)
    imgui.begin_child("##words", ImVec2(max_size.x, _CAPTION_HEIGHT))
    if search.tested_camera is not None:
        draw_note("Waiting for the picture ...")
    elif search.test_result is not None:
        draw_note(search.test_result[1])
    imgui.end_child()
    imgui.end_popup()


def _get_texture(picture: UInt8, number: int) -> moderngl.Texture:
    """Returns the texture of a test image. It is created once for each image."""
    if _TestImage.texture is None or _TestImage.number != number:
        if _TestImage.texture is not None:
            _TestImage.texture.release()
        height, width = picture.shape[:2]
        _TestImage.texture = get_window_context().texture((width, height), 3, picture.tobytes(), alignment=1)
        _TestImage.number = number
    return _TestImage.texture


def shorten_text(text: str, max_width: float) -> str:
    """Returns a text shortened at its end to fit the width."""
    if imgui.calc_text_size(text).x <= max_width:
        return text
    while len(text) > 1 and imgui.calc_text_size(f"{text}\u2026").x > max_width:
        text = text[:-1]
    return f"{text}\u2026"


_EDGE_LIST_HEIGHT = 96.0
"""Height in pixels of the list. It fits two edges."""
_ROW_HEIGHT = 42.0
"""Height in pixels of an edge: two lines of text next to its camera image."""
_PICTURE_WIDTH = 54.0
"""Width in pixels of a camera image. The image is slightly wider than high."""


class _Pictures:
    """The textures of the camera images, which need the window's context."""

    cached: tuple[moderngl.Context, PreviewTextures] | None = None

    @classmethod
    def get_texture(cls, edge: DiscoveredEdge, camera: CameraMessage | None) -> int | None:
        """Returns the OpenGL number of the texture with an edge's image, or None without an image."""
        context = get_window_context()
        if cls.cached is None or cls.cached[0] is not context:
            cls.cached = context, PreviewTextures(context)
        return cls.cached[1].get_texture(edge.service, camera)


def draw_edge_list(app: App) -> None:
    """Draws the list of edges on the network. A click connects to an edge."""
    search = app.state(PerformSession).edge_search
    search.poll()
    with open_list_box("found edges", _EDGE_LIST_HEIGHT) as available_width:
        for number, edge in enumerate(search.edges):
            _draw_edge(app, search, edge, number, available_width)
        if search.problem:
            draw_note("Cameras on the network cannot be searched. Type the address below.")
            draw_tooltip(search.problem)
        elif not search.edges:
            draw_note("Searching for cameras on the network ...")
    app.remember("found edges")


def describe_edge_state(edge: DiscoveredEdge) -> str:
    """Returns the state of an edge in the window's language."""
    if edge.announcement.problem:
        return tr("runs another version of enliven")
    if not edge.host:
        return tr("does not answer")
    if not edge.is_paired:
        return tr("not paired; run: enliven pair {0} CODE", str(edge.endpoint))
    if edge.announcement.relay_of:
        return tr("a relay: you can only watch")
    return tr_n("{0} character on its stage", "{0} characters on its stage", edge.announcement.characters)


def _draw_edge(
    app: App, search: EdgeSearch, edge: DiscoveredEdge, number: int, available_width: float
) -> None:
    """Draws one edge. Its row has the same height with and without an image."""
    position, draw_list = imgui.get_cursor_screen_pos(), imgui.get_window_draw_list()
    imgui.begin_disabled(not edge.is_usable)
    is_pressed = imgui.selectable(f"###found {number}", False, 0, ImVec2(available_width, _ROW_HEIGHT))[0]
    imgui.end_disabled()
    app.remember(f"found {number}")
    state_text = describe_edge_state(edge)
    draw_tooltip(f"{edge.announcement.name}, {edge.endpoint}: {state_text}")
    if is_pressed:
        app.run_and_report(partial(app.state(PerformSession).connect, str(edge.endpoint)))
    low = ImVec2(position.x, position.y + 2)
    far = ImVec2(position.x + _PICTURE_WIDTH, position.y + _ROW_HEIGHT - 2)
    draw_list.add_rect_filled(low, far, pack_colour(DARK), 4.0)
    texture = _Pictures.get_texture(edge, search.camera(edge))
    if texture is not None:
        draw_list.add_image(imgui.ImTextureRef(texture), low, far)
    left = position.x + _PICTURE_WIDTH + 8
    width = available_width - _PICTURE_WIDTH - 8
    name = f"{edge.announcement.name}  ·  {edge.endpoint.host}"
    colour = imgui.get_color_u32(imgui.Col_.text)
    draw_list.add_text(ImVec2(left, position.y + 3), colour, shorten_text(name, width))
    with use_small_text():
        ink = pack_colour(QUIET if edge.is_usable else WAIT)
        draw_list.add_text(ImVec2(left, position.y + 23), ink, shorten_text(state_text, width))
