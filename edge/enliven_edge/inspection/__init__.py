"""What the tracker sees and says, drawn over the depth image, as pictures and films for a technician."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
