from .motion import constraint_text
from .panel import draw_examples
from .performer import draw_performer
from .strip import draw_strip

__all__ = ["constraint_text", "draw_examples", "draw_performer", "draw_strip"]
