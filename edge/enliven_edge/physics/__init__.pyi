from .playground import Playground as Playground
from .settings import PhysicsSettings as PhysicsSettings
