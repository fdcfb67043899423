from .deformation.skinning import skin_vertices
from .document.character import Character, Pose
from .document.clip import Clip
from .document.history import History
from .document.project import Project
from .document.skeleton import Skeleton
from .errors import EnlivenError, InputError, ResourceError
from .formats.gltf.read import read_gltf
from .formats.project.file import read_project, write_project
from .mapping.plan import Plan
from .mapping.plan_file import read_plan
from .mapping.automatic_mapping import retarget
from .matching.matches import Match
from .matching.views import ScreenView
from .meshes.mesh import Mesh, fit_height
from .meshes.files import load_mesh, save_mesh
from .modeling.mesh.cut_surfaces import PlaneCut
from .oneshot.edits import copy, cut, merge, mesh_at
from .oneshot.exporting import export
from .oneshot.examples import fit_examples
from .oneshot.matching import match
from .oneshot.possession import possess
from .person.body import Body
from .person.joints import Joint
from .recording.recorder import Recorder
from .recording.reader import Recording
from .samples.shipped import cactus_project, load_sample
from .motion_clips.joint_positions import clip_of_bodies
from .motion_clips.recorded_characters import read_possessed
from .motion_clips.take_files import read_take

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
