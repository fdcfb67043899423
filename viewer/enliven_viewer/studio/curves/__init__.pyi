from .channels import NUMBERS as NUMBERS, CurveGroup as CurveGroup, CurveDot as CurveDot
from .curve_input import CurveInput as CurveInput
from .key_edits import KEYED as KEYED
from .scale import Scale as Scale
