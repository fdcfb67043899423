from .descriptors import raise_descriptor_limit
from .frame_rate import Pace
from .listening import check_open
from .outlet import Outlet, need_free

__all__ = ["Outlet", "Pace", "check_open", "need_free", "raise_descriptor_limit"]
