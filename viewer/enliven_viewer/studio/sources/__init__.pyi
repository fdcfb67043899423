from .motion_matches import (
    Chain as Chain,
    MotionMatch as MotionMatch,
    accepted as accepted,
    matching_view as matching_view,
    offers as offers,
)
from .source_view import SourceView as SourceView
