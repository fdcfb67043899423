from .dialogs import draw_dialogs
from .menu import draw_menu
from .side import draw_side
from .source import draw_source, split_side
from .style import apply_style, load_fonts
from .timeline import draw_timeline
from .toolbar import draw_toolbar
from .viewport_overlay import draw_overlay

__all__ = [
    "apply_style",
    "draw_dialogs",
    "draw_menu",
    "draw_overlay",
    "draw_side",
    "draw_source",
    "draw_timeline",
    "draw_toolbar",
    "load_fonts",
    "split_side",
]
