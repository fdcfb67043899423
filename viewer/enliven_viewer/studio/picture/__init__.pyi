from .viewport import Viewport

__all__ = ["Viewport"]
