"""A studio workspace for tests with a puppet, a star of five limbs, and the library's takes."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from studio_driver import HeadlessStage

from enliven.document.project import Project
from enliven.document.puppet import Plane
from enliven.meshes.mesh import Mesh
from enliven.modeling.puppet.edits import make_puppet, play_take
from enliven.modeling.puppet.points import add_point
from enliven.modeling.sketching.sketch import shape_from_stroke
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.workspace.workspace import Workspace

TIPS = {
    "head": (0.0, 0.9),
    "left": (-0.45, 0.55),
    "foot": (-0.2, 0.0),
    "other": (0.2, 0.0),
    "right": (0.45, 0.55),
}
"""Positions of the limbs' ends, x and y in metres."""
_GAPS = ((-0.09, 0.66), (-0.1, 0.42), (0.0, 0.22), (0.1, 0.42), (0.09, 0.66))
SIDES = Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
JOINTS = {"head": "bone 3", "left": "bone 1", "right": "bone 2", "foot": "root"}
"""The joint of the takes "sway" and "walk" that each control point follows."""


@cache
def star() -> Mesh:
    """Returns a standing figure with a head, two arms and two legs. Up to rounding, it is symmetric in x =
    0.
    """
    ring: list[np.ndarray] = []
    for tip, gap in zip(TIPS.values(), _GAPS, strict=True):
        way = np.array(tip) - np.array([0.0, 0.5])
        across = np.array([-way[1], way[0]]) / np.linalg.norm(way) * 0.05
        ring += [np.array(tip) - across, np.array(tip) + across, np.array(gap)]
    mesh = shape_from_stroke(np.array(ring), id="star").mesh
    assert mesh is not None
    return Mesh(mesh.vertices - [0.0, mesh.vertices[:, 1].min(), 0.0], mesh.faces, "star")


def vertex(name: str) -> int:
    """Returns the star's vertex at the end of a limb."""
    x, y = TIPS[name]
    return int(np.linalg.norm(star().vertices - [x, y, 0.0], axis=1).argmin())


def project_with(*names: str, take: str = "") -> Project:
    """Returns a project with the library's takes and the star, with control points at the ends of limbs."""
    from enliven_viewer.studio.workspace.files import read_library

    project = make_puppet(Project().with_takes(*read_library()), star(), "star")
    for name in names:
        project = add_point(
            project, "star", vertex(name), name, joint=JOINTS.get(name, ""), foot=name == "foot"
        )
    return play_take(project, "star", take) if take else project


def studio(folder: Path, *names: str, take: str = "") -> tuple[Workspace, HeadlessStage]:
    """Returns a workspace on such a project, with its puppet selected and its tool active, and a stage."""
    render = RenderSettings(shadow_size=64, contact_size=32, samples=1)
    workspace = Workspace.new(Editor(StudioSettings(render=render, width=1100, height=720)), folder)
    workspace.store.new(project_with(*names, take=take))
    workspace.editor.select_only("star")
    workspace.input.activate_tool("puppet")
    return workspace, HeadlessStage(workspace)
