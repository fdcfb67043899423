from .playground import Playground as Playground
from .settings import PhysicsSettings as PhysicsSettings
from .switch import PhysicsSwitch as PhysicsSwitch
