from .outliner import draw_outliner as draw_outliner, split_outliner as split_outliner
