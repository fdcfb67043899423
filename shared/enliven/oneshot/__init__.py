"""One-shot functions: each does a whole task of the library in one call; solver objects stand behind them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
