from .channels import Dot as Dot, CurveGroup as CurveGroup
from .curve_input import KEYED as KEYED, CurveInput as CurveInput
from .scale import Scale as Scale
