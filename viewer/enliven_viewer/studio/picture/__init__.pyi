from .glance import GlancePictures as GlancePictures, picture_of as picture_of
from .growing import GrowingPicture as GrowingPicture
from .viewport import Viewport as Viewport
