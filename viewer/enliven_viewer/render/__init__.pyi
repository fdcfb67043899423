from .camera import (
    DRAG_TURN as DRAG_TURN,
    Box as Box,
    CameraView as CameraView,
    FilmCamera as FilmCamera,
    OrbitCamera as OrbitCamera,
)
from .camera_moves import CameraMoves as CameraMoves
from .looks import LOOKS as LOOKS
from .renderer import EMPTY_BOX as EMPTY_BOX, Renderer as Renderer
from .scene import (
    PLAIN as PLAIN,
    Scene as Scene,
    SceneCharacter as SceneCharacter,
    SceneStyle as SceneStyle,
    scene_of as scene_of,
)
from .showing import Showing as Showing
from .materials import linear_from_srgb as linear_from_srgb
