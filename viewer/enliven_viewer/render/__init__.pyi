from .camera import (
    DRAG_TURN as DRAG_TURN,
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
    scene_of as scene_of,
)
from .overlay_visibility import OverlayVisibility as OverlayVisibility
from .materials import linear_from_srgb as linear_from_srgb
