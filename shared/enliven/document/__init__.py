"""The document: skeletons, clips, layers, rigged, possessed and example-driven characters, and the project.

All are values: an edit is a function from one project to the next, and undo is the one before.
"""

from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.clip import Clip
from enliven.document.constraints import Constraint, Coupling, Position, Velocity, names_in
from enliven.document.example_settings import ExampleSettings
from enliven.document.history import History
from enliven.document.layers import STILL, Layer, Ref, Span
from enliven.document.locomotion import Kind, LocomotionSettings, Switch
from enliven.document.pin import ContactSettings, Pin
from enliven.document.possessed import (
    GraphPart,
    GraphShape,
    PoseStream,
    Ride,
    character_of_graph,
    graph_shape_of,
)
from enliven.document.project import Project, same, unused
from enliven.document.props import BALL, BOX, Props
from enliven.document.puppet import ControlPoint, KeyPose, Plane, Puppet, PuppetLayer, character_of_puppet
from enliven.document.rigged import Shape, character_of, still_shape
from enliven.document.skeleton import Skeleton, skeleton_of
from enliven.document.surface_settings import ArapSettings

__all__ = [
    "BALL",
    "BOX",
    "STILL",
    "ArapSettings",
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
