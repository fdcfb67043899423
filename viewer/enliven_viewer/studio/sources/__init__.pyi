from .motion_matches import (
    Chain as Chain,
    MotionMatch as MotionMatch,
    apply_match as apply_match,
    make_match_view as make_match_view,
    rank_matches as rank_matches,
)
from .source_view import SourceView as SourceView
