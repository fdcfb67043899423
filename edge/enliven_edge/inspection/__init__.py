"""What the tracker sees and says, drawn over the depth image, as pictures and films for a technician."""

from enliven_edge.inspection.film import Film
from enliven_edge.inspection.inspector import Inspector
from enliven_edge.inspection.log import SensorLog
from enliven_edge.inspection.picture import captioned, contact_sheet, depth_picture, depth_span

__all__ = ["Film", "Inspector", "SensorLog", "captioned", "contact_sheet", "depth_picture", "depth_span"]
