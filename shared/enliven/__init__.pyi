from .deformation import skin_vertices
from .document import Character, Clip, History, Pose, Project, Skeleton
from .errors import EnlivenError, InputError, ResourceError
from .formats.gltf import read_gltf
from .formats.project import read_project, write_project
from .mapping import Plan, read_plan, retarget
from .matching import Match, ScreenView
from .meshes import Mesh, fit_height, load_mesh, save_mesh
from .modeling.mesh import PlaneCut
from .oneshot import copy, cut, export, fit_examples, match, merge, mesh_at, possess
from .person import Body, Joint
from .recording import Recorder, Recording
from .samples import cactus_project, load_sample
from .takes import clip_of_bodies, read_possessed, read_take

__version__: str
__all__ = [
    "Body",
    "Character",
    "Clip",
    "EnlivenError",
    "History",
    "InputError",
    "Joint",
    "Match",
    "Mesh",
    "Plan",
    "PlaneCut",
    "Pose",
    "Project",
    "Recorder",
    "Recording",
    "ResourceError",
    "ScreenView",
    "Skeleton",
    "cactus_project",
    "clip_of_bodies",
    "copy",
    "cut",
    "export",
    "fit_examples",
    "fit_height",
    "load_mesh",
    "load_sample",
    "match",
    "merge",
    "mesh_at",
    "possess",
    "read_gltf",
    "read_plan",
    "read_possessed",
    "read_project",
    "read_take",
    "retarget",
    "save_mesh",
    "skin_vertices",
    "write_project",
]
