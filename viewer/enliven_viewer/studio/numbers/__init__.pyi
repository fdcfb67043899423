from .figures import Figures as Figures
from .quantity import ANGLE as ANGLE, LENGTH as LENGTH, SHARE as SHARE, TIME as TIME, Quantity as Quantity
from .views import view_actions as view_actions
