from .viewport import Viewport as Viewport
