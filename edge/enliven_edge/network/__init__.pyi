from .tcp_listener import raise_descriptor_limit as raise_descriptor_limit
from .frame_rate import FrameRate as FrameRate
from .handlers import Handler as Handler, Handlers as Handlers
from .tcp_listener import check_open as check_open
from .outlet import Outlet as Outlet, check_free as check_free
