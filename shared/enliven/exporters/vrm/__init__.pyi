from .animation import VRMA as VRMA, write_vrma as write_vrma
from .avatar import VRM as VRM, write_vrm as write_vrm
from .humanoid import Humanoid as Humanoid, HumanoidBone as HumanoidBone, humanoid_of as humanoid_of
