from .growing import GrowingPicture as GrowingPicture
from .viewport import Viewport as Viewport
