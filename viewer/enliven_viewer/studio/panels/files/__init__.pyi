from .export_options import draw_export_options as draw_export_options
from .progress_box import draw_progress_box as draw_progress_box
