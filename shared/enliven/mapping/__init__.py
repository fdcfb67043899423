"""Mapping: which limb of a take drives which limb of a skeleton, found by geometry alone or read from a
file.
"""

from enliven.mapping.anatomy import Anatomy, Limb, anatomy_of
from enliven.mapping.applying import apply_plan
from enliven.mapping.automatic_mapping import Retargeted, automatic, retargeted
from enliven.mapping.facing import facing_of, turned_level
from enliven.mapping.plan import Mode, Plan
from enliven.mapping.plan_file import read_plan, write_plan

__all__ = [
    "Anatomy",
    "Limb",
    "Mode",
    "Plan",
    "Retargeted",
    "anatomy_of",
    "apply_plan",
    "automatic",
    "facing_of",
    "read_plan",
    "retargeted",
    "turned_level",
    "write_plan",
]
