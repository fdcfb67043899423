"""The edges on the network in the Perform panel: name, address, state, and a small camera image."""

from __future__ import annotations

from functools import partial

import moderngl
from imgui_bundle import ImVec2, imgui

from enliven.peers.edge_browser import DiscoveredEdge
from enliven.wire import CameraMessage
from enliven_viewer.language import tr, tr_n
from enliven_viewer.link.edge_search import EdgeSearch
from enliven_viewer.render.gl.context import get_window_context
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.style import draw_note, open_list_box, pack_colour, use_small_text
from enliven_viewer.studio.panels.stage.cameras import shorten_text
from enliven_viewer.studio.viewport.preview_textures import PreviewTextures
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import DARK, QUIET, WAIT

_LIST_HEIGHT = 96.0
"""Height in pixels of the list: two edges; more are scrolled."""
_ROW_HEIGHT = 42.0
"""Height in pixels of an edge: two lines of text next to its camera image."""
_PICTURE_WIDTH = 54.0
"""Width in pixels of a camera image, which is a little wider than high."""


class _Pictures:
    """The textures of the camera images, which need the window's context."""

    cached: tuple[moderngl.Context, PreviewTextures] | None = None

    @classmethod
    def get_texture(cls, edge: DiscoveredEdge, camera: CameraMessage | None) -> int | None:
        """Returns the OpenGL number of the texture with an edge's image; None without an image."""
        context = get_window_context()
        if cls.cached is None or cls.cached[0] is not context:
            cls.cached = context, PreviewTextures(context)
        return cls.cached[1].get_texture(edge.service, camera)


def draw_edge_list(workspace: Workspace) -> None:
    """Draws the list of edges on the network. A click connects to an edge."""
    search = workspace.perform.edge_search
    search.poll()
    with open_list_box("found edges", _LIST_HEIGHT) as available_width:
        for number, edge in enumerate(search.edges):
            _draw_edge(workspace, search, edge, number, available_width)
        if search.problem:
            draw_note("Cameras on the network are not searched. Type the address below.")
            draw_tooltip(search.problem)
        elif not search.edges:
            draw_note("Looking for cameras on the network ...")
    workspace.remember("found edges")


def describe_edge_state(edge: DiscoveredEdge) -> str:
    """Returns the state of an edge in the window's language."""
    if edge.announcement.problem:
        return tr("another release of enliven")
    if not edge.host:
        return tr("does not answer")
    if not edge.is_paired:
        return tr("not paired: enliven pair {0} CODE", str(edge.endpoint))
    if edge.announcement.relay_of:
        return tr("a relay, only to watch")
    return tr_n("{0} character on its stage", "{0} characters on its stage", edge.announcement.characters)


def _draw_edge(
    workspace: Workspace, search: EdgeSearch, edge: DiscoveredEdge, number: int, available_width: float
) -> None:
    """Draws one edge. Its row has the same height with and without an image."""
    position, draw_list = imgui.get_cursor_screen_pos(), imgui.get_window_draw_list()
    imgui.begin_disabled(not edge.is_usable)
    pressed = imgui.selectable(f"###found {number}", False, 0, ImVec2(available_width, _ROW_HEIGHT))[0]
    imgui.end_disabled()
    workspace.remember(f"found {number}")
    state_text = describe_edge_state(edge)
    draw_tooltip(f"{edge.announcement.name}, {edge.endpoint}: {state_text}")
    if pressed:
        workspace.attempt(partial(workspace.perform.connect, str(edge.endpoint)))
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
