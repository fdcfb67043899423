"""The renderer: a scene of characters, bodies, props and marks becomes one picture."""

from enliven_viewer.render.camera import Box, FilmCamera, OrbitCamera, View
from enliven_viewer.render.renderer import EMPTY_BOX, Renderer
from enliven_viewer.render.scene import Actor, Look, Scene, scene_of
from enliven_viewer.render.skinned import linear

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
