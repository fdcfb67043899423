from .channels import (
    LAYER_KEY_ATTRIBUTES as LAYER_KEY_ATTRIBUTES,
    CurveGroup as CurveGroup,
    CurveDot as CurveDot,
)
from .curve_input import CurveInput as CurveInput
from .key_edits import KEY_ATTRIBUTES as KEY_ATTRIBUTES
from .scale import Scale as Scale
