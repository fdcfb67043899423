"""Contributions of features to the studio: panels, overlays, layers of the 3D view, and file types."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import moderngl

from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.viewport.viewport import RenderPass

PanelPlace = Literal[
    "right",
    "outliner",
    "selection",
    "below outliner",
    "bottom",
    "above timeline",
    "beside view",
    "below view",
]


@dataclass(frozen=True)
class Panel:
    """A panel of the window. At the right, it replaces a workspace's usual panel.

    Attributes:
        name: a permanent name.
        draw: draws the panel in an area of the window.
        is_shown: returns whether the panel is open.
        workspaces: names of the workspaces that can show it; empty for all.
        back: name of the widget that closes it. The tour points at it if the panel hides its target.
        place: where the panel is; "selection" is below the outliner, in place of the usual
            properties; "below outliner" is below both.
    """

    name: str
    draw: Callable[[Area], object]
    is_shown: Callable[[], bool] = lambda: True
    workspaces: tuple[str, ...] = ()
    back: str = ""
    place: PanelPlace = "right"


@dataclass(frozen=True)
class ViewOverlay:
    """Flat marks and text over the 3D view, below all panels.

    Attributes:
        draw: draws the overlay in the area of the view.
        find_bottom: returns the distance in pixels from the top of the view to the bottom of its large text,
            so that other text is drawn below; 0 without text.
    """

    draw: Callable[[Area], object]
    find_bottom: Callable[[], float] = lambda: 0.0


@dataclass(frozen=True)
class ViewLayer:
    """A layer of the 3D view.

    Attributes:
        make_pass: makes the render pass, with the window's OpenGL context.
        hides_characters: returns True if only this layer is drawn, without characters.
    """

    make_pass: Callable[[moderngl.Context], RenderPass]
    hides_characters: Callable[[], bool] = lambda: False


@dataclass(frozen=True)
class FileType:
    """A type of file that can be opened.

    Attributes:
        suffixes: its file extensions, with the dot.
        read: returns the content of a file. It may run in a thread.
        add: adds the content to the project.
    """

    suffixes: tuple[str, ...]
    read: Callable[[Path], Any]
    add: Callable[[Editor, Path, Any], None]
