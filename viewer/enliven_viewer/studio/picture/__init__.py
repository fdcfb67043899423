"""The studio's 3-D picture: shapes by the viewer's renderer, skeletons over them."""

from enliven_viewer.studio.picture.viewport import Viewport

__all__ = ["Viewport"]
