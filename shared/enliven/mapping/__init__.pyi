from .anatomy import Anatomy, SkeletonLimb, anatomy_of
from .applying import apply_plan
from .automatic_mapping import Retargeted, automatic, retarget
from .facing import facing_of, turned_level
from .plan import Mode, Plan
from .plan_file import read_plan, write_plan

__all__ = [
    "Anatomy",
    "Mode",
    "Plan",
    "Retargeted",
    "SkeletonLimb",
    "anatomy_of",
    "apply_plan",
    "automatic",
    "facing_of",
    "read_plan",
    "retarget",
    "turned_level",
    "write_plan",
]
