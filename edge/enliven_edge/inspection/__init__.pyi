from .inspector import Inspector
from .log import SensorLog
from .picture import captioned, contact_sheet, depth_picture, depth_span

__all__ = ["Inspector", "SensorLog", "captioned", "contact_sheet", "depth_picture", "depth_span"]
