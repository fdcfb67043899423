from .film import DepthFilm
from .inspector import Inspector
from .log import SensorLog
from .picture import captioned, contact_sheet, depth_picture, depth_span

__all__ = ["DepthFilm", "Inspector", "SensorLog", "captioned", "contact_sheet", "depth_picture", "depth_span"]
