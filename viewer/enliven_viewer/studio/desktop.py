"""What the window has from the desktop: its title, and files that are dropped onto it."""

from __future__ import annotations

from pathlib import Path

import glfw
from imgui_bundle.glfw_utils import glfw_window_hello_imgui

from enliven_viewer.studio.workspace import Workspace


class Desktop:
    """The title of the studio's window, and files dropped onto it; to be made once the window is open."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace, self._title = workspace, ""
        self._window = glfw_window_hello_imgui()
        self._dropped: list[Path] = []
        glfw.set_drop_callback(self._window, self._drop)

    def follow(self) -> None:
        """Open what was dropped, and show the project's name; to be called once a picture."""
        dropped, self._dropped = self._dropped, []
        self._workspace.drop(dropped)
        title = self._workspace.store.title
        if title != self._title:
            self._title = title
            glfw.set_window_title(self._window, title)

    def _drop(self, window: object, paths: list[str]) -> None:
        self._dropped += [Path(path) for path in paths]
