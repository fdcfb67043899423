"""Matching: which part of a skeleton a pose means (AniMesh, section 4): abstraction, ranking, picking,
symmetry.
"""

from enliven.matching import views
from enliven.matching.assignment import least_cost
from enliven.matching.board import Board, Row
from enliven.matching.matches import Match, Ranking
from enliven.matching.picking import Pick, Picker, PickingSettings
from enliven.matching.ranking import Matcher, RankingSettings
from enliven.matching.source import Source, source_of, source_of_skeleton
from enliven.matching.symmetry import EqualLimbs, equal_limbs
from enliven.matching.views import View, best_view

__all__ = [
    "Board",
    "EqualLimbs",
    "Match",
    "Matcher",
    "Pick",
    "Picker",
    "PickingSettings",
    "Ranking",
    "RankingSettings",
    "Row",
    "Source",
    "View",
    "best_view",
    "equal_limbs",
    "least_cost",
    "source_of",
    "source_of_skeleton",
    "views",
]
