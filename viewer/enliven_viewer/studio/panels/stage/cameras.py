"""The cameras of this machine in the Perform panel: each starts with a click, or shows why it cannot."""

from __future__ import annotations

import moderngl
from imgui_bundle import ImVec2, imgui

from enliven.arrays import UInt8
from enliven_viewer.language import labelled, tr
from enliven_viewer.render.gl import window_context
from enliven_viewer.studio.panel_layout import Area
from enliven_viewer.studio.panels.fields import tooltip
from enliven_viewer.studio.panels.style import heading, list_box, quiet, tinted
from enliven_viewer.studio.perform import Camera, CameraSearch
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import WAIT

_EYE_ICON = "\uf06e"
"""Icon of Font Awesome 4: an eye."""
_TEST_BUTTON_WIDTH = 42.0
"""Width in pixels of the test image button at the right of a camera's button."""
_LIST_HEIGHT = 108.0
"""Height in pixels of the list: three cameras, or one and its problem; more are scrolled."""
_TEST_IMAGE_SIZE = (320.0, 240.0)
"""Width and height in pixels that a test image is fitted into, with any aspect ratio."""
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


def draw_cameras(workspace: Workspace, area: Area) -> None:
    """Draws the list of cameras. The first call starts the search.

    The list has the same height before, during and after the search, so that nothing below it moves.
    """
    search = workspace.perform.cameras
    if search.cameras is None and not search.searching:
        search.begin()
    search.poll()
    heading("Cameras here")
    looks = False
    with list_box("cameras", _LIST_HEIGHT) as room:
        if search.problem:
            quiet(search.problem)
        for number, camera in enumerate(search.cameras or ()):
            looks |= _camera(workspace, search, camera, number, room)
        if not search.cameras and not search.problem:
            quiet("Looking ..." if search.searching else "None is plugged in. Plug one in, and look again.")
    workspace.remember("cameras")
    imgui.begin_disabled(search.searching)
    if imgui.button(
        labelled(tr("Looking for cameras ..."), "search")
        if search.searching
        else labelled(tr("Look again"), "search"),
        ImVec2(-1, 0),
    ):
        search.begin()
    imgui.end_disabled()
    workspace.remember("look for cameras")
    if looks:
        imgui.open_popup(_POPUP_ID)
    _look(workspace, search, area)


def _camera(workspace: Workspace, search: CameraSearch, camera: Camera, number: int, room: float) -> bool:
    """Draws a camera, ``room`` pixels wide: the start button, the test image button, and its problem.

    Returns:
        True if a test image was requested.
    """
    looks = False
    imgui.begin_disabled(not camera.can_start)
    beside = _TEST_BUTTON_WIDTH if camera.depth and camera.can_start else 0.0
    if imgui.button(
        f"{fitting(camera.title, room - beside - 16)}###camera {number}", ImVec2(room - beside, 0)
    ):
        search.close()  # End a running camera test, which would block the camera for the edge.
        workspace.attempt(lambda: workspace.perform.connect_local(*camera.words))
    imgui.end_disabled()
    workspace.remember(f"camera {number}")
    tooltip(tr("Perform in front of it: {0}", camera.title) if camera.can_start else camera.title)
    if beside:
        imgui.same_line()
        imgui.begin_disabled(search.looking is not None)
        if imgui.button(
            f"{_EYE_ICON}##look {number}", ImVec2(_TEST_BUTTON_WIDTH - imgui.get_style().item_spacing.x, 0)
        ):
            search.look(camera)
            looks = True
        imgui.end_disabled()
        workspace.remember(f"look {number}")
        tooltip("See what it sees")
    if camera.trouble:
        with tinted(WAIT, imgui.Col_.text):
            imgui.push_text_wrap_pos(0.0)
            imgui.text_unformatted(f"{camera.trouble[:1].upper()}{camera.trouble[1:]}.")
            imgui.pop_text_wrap_pos()
        quiet(camera.mend)
    elif camera.hint:
        quiet(f"{camera.hint[:1].upper()}{camera.hint[1:]}")
    return looks


def _look(workspace: Workspace, search: CameraSearch, area: Area) -> None:
    """Draws a camera's last test image in a popup next to the panel.

    The popup has the same size while it waits for the image.
    """
    wide = _TEST_IMAGE_SIZE[0] + 2 * imgui.get_style().window_padding.x
    imgui.set_next_window_pos(ImVec2(area.x - _GAP - wide, area.y + _TEST_IMAGE_TOP))
    if not imgui.begin_popup(_POPUP_ID):
        return
    camera = search.looking or (search.looked[0] if search.looked is not None else None)
    room = ImVec2(*_TEST_IMAGE_SIZE)
    imgui.text_unformatted(fitting(camera.title if camera is not None else "", room.x))
    at = imgui.get_cursor_screen_pos()
    imgui.dummy(room)
    workspace.remember("camera view")
    if search.looking is None and search.picture is not None:
        texture = _texture(search.picture, search.number)
        high, wide = search.picture.shape[:2]
        scale = min(room.x / wide, room.y / high)
        low = ImVec2(at.x + (room.x - scale * wide) / 2, at.y + (room.y - scale * high) / 2)
        far = ImVec2(low.x + scale * wide, low.y + scale * high)
        imgui.get_window_draw_list().add_image(imgui.ImTextureRef(texture.glo), low, far)
    imgui.begin_child("##words", ImVec2(room.x, _CAPTION_HEIGHT))
    if search.looking is not None:
        quiet("Looking ...")
    elif search.looked is not None:
        quiet(search.looked[1])
    imgui.end_child()
    imgui.end_popup()


def _texture(picture: UInt8, number: int) -> moderngl.Texture:
    """Returns the texture of a test image, which is made once for each image."""
    if _TestImage.texture is None or _TestImage.number != number:
        if _TestImage.texture is not None:
            _TestImage.texture.release()
        high, wide = picture.shape[:2]
        _TestImage.texture = window_context().texture((wide, high), 3, picture.tobytes(), alignment=1)
        _TestImage.number = number
    return _TestImage.texture


def fitting(text: str, room: float) -> str:
    """Returns a text shortened at its end to fit the width."""
    if imgui.calc_text_size(text).x <= room:
        return text
    while len(text) > 1 and imgui.calc_text_size(f"{text}\u2026").x > room:
        text = text[:-1]
    return f"{text}\u2026"
