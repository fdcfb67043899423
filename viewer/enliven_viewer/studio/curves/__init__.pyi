from .channels import NUMBERS as NUMBERS, CurveGroup as CurveGroup, Dot as Dot
from .curve_input import CurveInput as CurveInput
from .edits import KEYED as KEYED
from .scale import Scale as Scale
