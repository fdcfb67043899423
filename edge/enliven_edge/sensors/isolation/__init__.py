"""Process isolation of sensors with libraries that may crash or hang: a helper process, images in shared
memory."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
