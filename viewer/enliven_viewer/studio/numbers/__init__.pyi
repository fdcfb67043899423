from .selection_transform import SelectionTransform as SelectionTransform
from .quantity import ANGLE as ANGLE, LENGTH as LENGTH, SHARE as SHARE, TIME as TIME, Quantity as Quantity
from .view_bookmarks import view_actions as view_actions
