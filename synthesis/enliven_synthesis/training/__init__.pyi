from .dataset import Album, render_album

__all__ = ["Album", "render_album"]
