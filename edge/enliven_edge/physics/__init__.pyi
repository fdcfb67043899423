from .engine import need_engine as need_engine
from .playground import Playground as Playground
from .settings import PhysicsSettings as PhysicsSettings
