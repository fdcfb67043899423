from .descriptors import raise_descriptor_limit
from .frame_rate import FrameRate
from .handlers import Handler, Handlers
from .listening import check_open
from .outlet import Outlet, need_free

__all__ = ["FrameRate", "Handler", "Handlers", "Outlet", "check_open", "need_free", "raise_descriptor_limit"]
