from .channels import Dot as Dot, CurveGroup as CurveGroup
from .curve_input import CurveInput as CurveInput
from .scale import Scale as Scale
