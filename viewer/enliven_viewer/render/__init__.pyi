from .camera import Box, FilmCamera, OrbitCamera, View
from .renderer import EMPTY_BOX, Renderer
from .scene import Actor, Look, Scene, scene_of
from .skinned import linear

__all__ = [
    "EMPTY_BOX",
    "Actor",
    "Box",
    "FilmCamera",
    "Look",
    "OrbitCamera",
    "Renderer",
    "Scene",
    "View",
    "linear",
    "scene_of",
]
