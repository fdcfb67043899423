from .changed_file import draw_changed_file as draw_changed_file
from .unsaved import draw_unsaved as draw_unsaved
