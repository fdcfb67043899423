"""The cameras of this machine in the Perform panel: each starts with a click, or shows why it cannot."""

from __future__ import annotations

import moderngl
from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import labelled, tr
from enliven_viewer.render.gl import window_context
from enliven_viewer.studio.panels.fields import told
from enliven_viewer.studio.panels.style import heading, quiet, tinted
from enliven_viewer.studio.perform import Camera, CameraSearch
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import WAIT

_LOOK = "\uf06e"
"""Icon of Font Awesome 4: an eye."""
_BESIDE = 42.0
"""Width in pixels of the test image button at the right of a camera's button."""


class _Shown:
    """The texture of the last test image."""

    texture: moderngl.Texture | None = None
    number = 0


def draw_cameras(workspace: Workspace) -> None:
    """Draws the list of cameras. The first call starts the search."""
    search = workspace.perform.cameras
    if search.cameras is None and not search.searching:
        search.begin()
    search.poll()
    heading("Cameras here")
    if search.problem:
        quiet(search.problem)
    for number, camera in enumerate(search.cameras or ()):
        _camera(workspace, search, camera, number)
    if search.cameras == () and not search.problem and not search.searching:
        quiet("None is plugged in. Plug one in, and look again.")
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


def _camera(workspace: Workspace, search: CameraSearch, camera: Camera, number: int) -> None:
    """Draws a camera: the start button, the test image button, and its problem."""
    imgui.begin_disabled(not camera.can_start)
    room = imgui.get_content_region_avail().x
    beside = _BESIDE if camera.depth and camera.can_start else 0.0
    if imgui.button(
        f"{fitting(camera.title, room - beside - 16)}###camera {number}", ImVec2(room - beside, 0)
    ):
        search.close()  # a running test would block the camera for the edge
        workspace.attempt(lambda: workspace.perform.connect_nearby(*camera.words))
    imgui.end_disabled()
    workspace.remember(f"camera {number}")
    told(tr("Perform before it: {0}", camera.title) if camera.can_start else camera.title)
    if beside:
        imgui.same_line()
        imgui.begin_disabled(search.looking is not None)
        if imgui.button(f"{_LOOK}##look {number}", ImVec2(-1, 0)):
            search.look(camera)
        imgui.end_disabled()
        workspace.remember(f"look {number}")
        told("See what it sees")
    if camera.trouble:
        with tinted(WAIT, imgui.Col_.text):
            imgui.push_text_wrap_pos(0.0)
            imgui.text_unformatted(f"{camera.trouble[:1].upper()}{camera.trouble[1:]}.")
            imgui.pop_text_wrap_pos()
        quiet(camera.mend)
    elif camera.hint:
        quiet(f"{camera.hint[:1].upper()}{camera.hint[1:]}")
    if search.looking == camera:
        quiet("Looking ...")
    elif search.looked is not None and search.looked[0] == camera:
        _look(search)


def _look(search: CameraSearch) -> None:
    """Draws the last test image, or the error."""
    assert search.looked is not None
    picture = search.picture
    if picture is not None:
        high, wide = picture.shape[:2]
        if _Shown.texture is None or _Shown.number != search.number:
            if _Shown.texture is not None:
                _Shown.texture.release()
            _Shown.texture = window_context().texture((wide, high), 3, picture.tobytes(), alignment=1)
            _Shown.number = search.number
        room = imgui.get_content_region_avail().x
        imgui.image(imgui.ImTextureRef(_Shown.texture.glo), ImVec2(room, room * high / wide))
    quiet(search.looked[1])


def fitting(text: str, room: float) -> str:
    """Returns a text shortened at its end to fit the width."""
    if imgui.calc_text_size(text).x <= room:
        return text
    while len(text) > 1 and imgui.calc_text_size(f"{text}\u2026").x > room:
        text = text[:-1]
    return f"{text}\u2026"
