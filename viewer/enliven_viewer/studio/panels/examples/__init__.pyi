from .motion import told
from .panel import draw_examples
from .performer import draw_performer
from .strip import draw_strip

__all__ = ["draw_examples", "draw_performer", "draw_strip", "told"]
