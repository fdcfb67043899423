from .camera import DRAG_TURN, Box, CameraView, FilmCamera, OrbitCamera
from .renderer import EMPTY_BOX, Renderer
from .scene import PLAIN, Scene, SceneCharacter, SceneStyle, scene_of
from .skinned import linear_from_srgb

__all__ = [
    "DRAG_TURN",
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
    "linear_from_srgb",
    "scene_of",
]
