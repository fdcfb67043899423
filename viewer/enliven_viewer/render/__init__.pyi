from .camera import (
    TURN_PER_PIXEL as TURN_PER_PIXEL,
    Box as Box,
    CameraView as CameraView,
    FilmCamera as FilmCamera,
    OrbitCamera as OrbitCamera,
)
from .camera_moves import CameraMoves as CameraMoves
from .stage_look import LOOKS as LOOKS
from .renderer import EMPTY_BOX as EMPTY_BOX, Renderer as Renderer
from .scene import (
    PLAIN as PLAIN,
    Scene as Scene,
    SceneCharacter as SceneCharacter,
    SceneStyle as SceneStyle,
    make_scene as make_scene,
)
from .overlay_visibility import OverlayVisibility as OverlayVisibility
from .materials import linear_from_srgb as linear_from_srgb
