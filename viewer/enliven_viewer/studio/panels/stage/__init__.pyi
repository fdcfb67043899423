from .audience import draw_audience as draw_audience
from .recorded_clip import draw_growing as draw_growing
from .camera_preview import draw_inset as draw_inset
from .live import draw_live as draw_live
from .perform import draw_perform as draw_perform
from .workspace_tabs import draw_rooms as draw_rooms, rooms_width as rooms_width
from .side_view import draw_side_view as draw_side_view, place_of_side_view as place_of_side_view
from .scan import draw_scan as draw_scan, draw_scan_over as draw_scan_over
