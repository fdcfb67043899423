from . import views
from .assignment import least_cost
from .board import Board, MatchRow
from .body_limbs import BodySource, body_source
from .matches import Match, Ranking
from .picking import Pick, Picker, PickingSettings
from .ranking import Matcher, RankingSettings
from .source import MatchSource, source_of, source_of_skeleton
from .symmetry import EqualLimbs, equal_limbs
from .views import ScreenView, best_view

__all__ = [
    "Board",
    "BodySource",
    "EqualLimbs",
    "Match",
    "MatchRow",
    "MatchSource",
    "Matcher",
    "Pick",
    "Picker",
    "PickingSettings",
    "Ranking",
    "RankingSettings",
    "ScreenView",
    "best_view",
    "body_source",
    "equal_limbs",
    "least_cost",
    "source_of",
    "source_of_skeleton",
    "views",
]
