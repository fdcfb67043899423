from .camera import Box, CameraView, FilmCamera, OrbitCamera
from .renderer import EMPTY_BOX, Renderer
from .scene import PLAIN, Scene, SceneCharacter, SceneStyle, scene_of
from .skinned import linear

__all__ = [
    "EMPTY_BOX",
    "PLAIN",
    "Box",
    "CameraView",
    "FilmCamera",
    "OrbitCamera",
    "Renderer",
    "Scene",
    "SceneCharacter",
    "SceneStyle",
    "linear",
    "scene_of",
]
