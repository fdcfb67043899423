from .audience import draw_audience as draw_audience
from .recorded_clip import draw_recorded_clip as draw_recorded_clip
from .camera_preview import draw_camera_previews as draw_camera_previews
from .live import draw_live as draw_live
from .perform import draw_perform as draw_perform
from .workspace_tabs import draw_workspace_tabs as draw_workspace_tabs, measure_tabs as measure_tabs
from .side_view import draw_side_view as draw_side_view, find_side_view_area as find_side_view_area
from .scan import draw_scan as draw_scan, draw_scan_overlay as draw_scan_overlay
