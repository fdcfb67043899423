from .motion import describe_constraint as describe_constraint
from .panel import draw_examples as draw_examples
from .performer import draw_performer as draw_performer
from .strip import draw_strip as draw_strip
