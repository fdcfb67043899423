from .audience import draw_audience as draw_audience
from .recorded_clip import draw_recorded_clip as draw_recorded_clip
from .camera_preview import draw_camera_previews as draw_camera_previews
from .live import draw_live as draw_live
from .perform import draw_perform as draw_perform
from .workspace_tabs import draw_workspace_tabs as draw_workspace_tabs, tabs_width as tabs_width
from .side_view import draw_side_view as draw_side_view, place_of_side_view as place_of_side_view
from .scan import draw_scan as draw_scan, draw_scan_over as draw_scan_over
