from .bake import BakedSurface as BakedSurface, Frames as Frames, bake_surface as bake_surface
from .frames import SurfaceFrames as SurfaceFrames, evaluate_states as evaluate_states
from .maps import stretch_axes as stretch_axes
from .morphs import BakedMorphs as BakedMorphs, bake_morphs as bake_morphs
from .nodes import EdgeGraph as EdgeGraph
from .settings import BakeError as BakeError, BakeSettings as BakeSettings
