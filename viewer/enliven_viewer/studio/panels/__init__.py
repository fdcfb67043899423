"""The studio's panels: menu, toolbar, dialogues, timeline and what is chosen."""

from enliven_viewer.studio.panels.dialogs import draw_dialogs
from enliven_viewer.studio.panels.menu import draw_menu
from enliven_viewer.studio.panels.side import draw_side
from enliven_viewer.studio.panels.source import draw_source, split_side
from enliven_viewer.studio.panels.style import apply_style, load_fonts
from enliven_viewer.studio.panels.timeline import draw_timeline
from enliven_viewer.studio.panels.toolbar import draw_toolbar
from enliven_viewer.studio.panels.viewport_overlay import draw_over

__all__ = [
    "apply_style",
    "draw_dialogs",
    "draw_menu",
    "draw_over",
    "draw_side",
    "draw_source",
    "draw_timeline",
    "draw_toolbar",
    "load_fonts",
    "split_side",
]
