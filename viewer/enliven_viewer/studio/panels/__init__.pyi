from .curves import draw_curves as draw_curves
from .dialogs import draw_dialogs as draw_dialogs
from .menu import draw_menu as draw_menu
from .side import draw_side as draw_side
from .source import draw_source as draw_source, split_side as split_side
from .start import draw_tour as draw_tour
from .style import apply_colours as apply_colours, apply_style as apply_style, load_fonts as load_fonts
from .timeline import draw_timeline as draw_timeline
from .toolbar import draw_toolbar as draw_toolbar
from .viewport_overlay import draw_overlay as draw_overlay
