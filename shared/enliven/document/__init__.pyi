from .body_take import BodyTake, HoldChange
from .character import Character, Pose, SkinWeights
from .clip import Clip
from .constraints import Constraint, Coupling, Position, Velocity, names_in
from .example_settings import ExampleSettings
from .history import History
from .layers import STILL, Layer, Ref, Span
from .locomotion import Kind, LocomotionSettings, Switch
from .pin import ContactSettings, Pin
from .possessed import GraphPart, GraphShape, PoseStream, Ride, character_of_graph, graph_shape_of
from .project import Project, same, unused
from .props import BALL, BOX, Props
from .puppet import ControlPoint, KeyPose, Plane, Puppet, PuppetLayer, character_of_puppet
from .rigged import Shape, character_of, still_shape
from .skeleton import Skeleton, skeleton_of
from .surface_settings import ArapSettings
from .time_map import TimeMap

__all__ = [
    "BALL",
    "BOX",
    "STILL",
    "ArapSettings",
    "BodyTake",
    "Character",
    "Clip",
    "Constraint",
    "ContactSettings",
    "ControlPoint",
    "Coupling",
    "ExampleSettings",
    "GraphPart",
    "GraphShape",
    "History",
    "HoldChange",
    "KeyPose",
    "Kind",
    "Layer",
    "LocomotionSettings",
    "Pin",
    "Plane",
    "Pose",
    "PoseStream",
    "Position",
    "Project",
    "Props",
    "Puppet",
    "PuppetLayer",
    "Ref",
    "Ride",
    "Shape",
    "Skeleton",
    "SkinWeights",
    "Span",
    "Switch",
    "TimeMap",
    "Velocity",
    "character_of",
    "character_of_graph",
    "character_of_puppet",
    "graph_shape_of",
    "names_in",
    "same",
    "skeleton_of",
    "still_shape",
    "unused",
]
