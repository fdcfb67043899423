from .tcp_listener import raise_descriptor_limit as raise_descriptor_limit
from .frame_rate import FrameRate as FrameRate
from .handlers import Handler as Handler, Handlers as Handlers
from .access import Access as Access, open_access as open_access
from .tcp_listener import is_local as is_local
from .outlet import Outlet as Outlet, check_free as check_free
