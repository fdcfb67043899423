from .selection_transform import SelectionTransform as SelectionTransform
from .quantity import (
    ANGLE as ANGLE,
    LENGTH as LENGTH,
    PERCENTAGE as PERCENTAGE,
    TIME as TIME,
    Quantity as Quantity,
)
from .view_bookmarks import make_view_actions as make_view_actions
