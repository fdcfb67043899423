from . import views as views
from .assignment import least_cost as least_cost
from .match_list import MatchList as MatchList, MatchRow as MatchRow
from .body_limbs import (
    BodySource as BodySource,
    body_source as body_source,
    joints_of_limb as joints_of_limb,
    limb_number as limb_number,
)
from .matches import Match as Match, Ranking as Ranking
from .picking import Pick as Pick, Picker as Picker, PickingSettings as PickingSettings
from .ranking import Matcher as Matcher, RankingSettings as RankingSettings
from .source import (
    MatchSource as MatchSource,
    source_of as source_of,
    source_of_skeleton as source_of_skeleton,
)
from .symmetry import EqualLimbs as EqualLimbs, equal_limbs as equal_limbs
from .views import ScreenView as ScreenView, best_view as best_view
