from .inspector import Inspector as Inspector
from .log import SensorLog as SensorLog
from .picture import (
    add_caption as add_caption,
    contact_sheet as contact_sheet,
    depth_picture as depth_picture,
    depth_span as depth_span,
)
