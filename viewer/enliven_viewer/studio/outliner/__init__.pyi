from .actions import (
    require_single_shape as require_single_shape,
    make_choosing_actions as make_choosing_actions,
    make_outliner_actions as make_outliner_actions,
)
from .outliner import Outliner as Outliner
from .tree import (
    CHARACTER as CHARACTER,
    GROUP as GROUP,
    HANDLE as HANDLE,
    LIVE as LIVE,
    TAKE as TAKE,
    Row as Row,
)
