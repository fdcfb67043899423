from .numbers import draw_numbers as draw_numbers
from .outliner import draw_outliner as draw_outliner, split_outliner as split_outliner
