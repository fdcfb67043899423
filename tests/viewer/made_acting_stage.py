"""Builds a small project in which every action of the studio is possible, and the selection for each
action.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from made_studio_puppets import project_with
from strokes import limb

from enliven.document import graph_shape_at_rest
from enliven.document.project import Project
from enliven.formats.project.file import write_project
from enliven.modeling.edits import paint_character, scale_character
from enliven.modeling.puppet.poses import add_key_pose
from enliven.modeling.sketching.sketch import shape_from_stroke
from enliven.motion.layers.retarget import bind_chain
from enliven.sounds import SOUND_RATE, Sound
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.outliner.outliner import Outliner
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.tools.base import Pointer
from enliven_viewer.studio.workspace.workspace import Workspace

LIMB = {"character": "limb", "handle": None, "chain": (), "layer": None}
TIP = {"character": "limb", "handle": 2, "chain": (), "layer": None}
CHAIN = {"character": "limb", "handle": None, "chain": (0, 1, 2), "layer": None}
POST = {"character": "post", "handle": None, "chain": (), "layer": None}
STAR = {"character": "star", "handle": None, "chain": (), "layer": None}
NEEDS: dict[str, dict[str, object]] = {
    "motion.copy": CHAIN,
    "motion.paste": CHAIN,
    "motion.spread": TIP,
    "motion.pin": TIP,
    "motion.key": TIP,
    "motion.unkey": TIP,
    "shape.solve": POST,
    "shape.bake": STAR,
    "paint.clear": POST,
    "file.session": STAR,
}
"""Selection that an action needs. Actions without an entry need a selected limb."""


def acting_stage(folder: Path, width: int = 1280, height: int = 720) -> Workspace:
    """Returns a workspace with a waving limb, a possessed post and a puppet. Each was edited once."""
    project = project_with("head", "left", "right", "foot", take="sway")
    rest = project.puppets["star"].rest
    for seconds, places in ((0.0, rest), (0.8, np.add(rest, [0.1, 0.03, 0.0]))):
        project = add_key_pose(project, "star", "sway", seconds, places)
    bones = np.array([[0.0, 0.0], [0.05, 0.3], [0.0, 0.6], [0.0, 0.9]])
    pill = limb(bones, np.array([0.08, 0.07, 0.06, 0.05]))
    shape = shape_from_stroke(np.add(pill, [-0.9, 0.4]), id="limb")
    beside = replace(shape.mesh, vertices=np.add(shape.mesh.vertices, [1.8, 0.0, 0.0]), name="post")
    ends = np.array([[0.9, 0.45, 0.0], [0.9, 0.95, 0.0]])
    post, stream = graph_shape_at_rest("post", ends, np.array([[0, 1]], np.int32), beside)
    project = project.with_streams(stream).with_characters(shape, post)
    joints = tuple(range(len(shape.skeleton)))
    project = bind_chain(project, "limb", joints, "wave", (0, 1, 2, 3), loop=True)
    render = RenderSettings(shadow_size=64, contact_size=32, samples=1)
    settings = StudioSettings(render=render, width=width, height=height)
    workspace = Workspace.new(Editor(settings), folder)
    workspace.store.new(project)
    write_project(folder / "recent.enliven", project)
    workspace.preferences.recent = [str(folder / "recent.enliven")]
    return workspace


def ready_for(workspace: Workspace, action: Action) -> None:
    """Selects what an action needs, and makes undo, redo and paste possible."""
    editor = workspace.editor
    workspace.state(PerformSession).active_workspace = (action.workspaces or ("Animate",))[0]
    workspace.input.activate_tool("choose")
    workspace.state(Outliner).renaming = ""
    editor.go_to(0)
    for factor in (1.1, 1.2):
        editor.edit("scale limb", lambda project, by=factor: scale_character(project, "limb", by))
    if action.id == "edit.redo":
        editor.undo()
    if action.id == "edit.paste":
        editor.select(**LIMB)
        workspace.commands.copy()
    if action.id == "motion.paste":
        editor.select(**CHAIN)
        workspace.commands.motion.copy()
    if action.id.startswith("view.take_"):
        workspace.actions.do(action.id.replace("take", "store"))
    if action.id == "shape.show_all":
        workspace.state(Outliner).set_hidden("star", is_hidden=True)
    if action.id == "shape.unlock_all":
        workspace.state(Outliner).set_locked("star", is_locked=True)
    if action.id.startswith("clip."):
        editor.scrub(0.5)
    if action.id.startswith("sound."):
        hum = Sound("hum", np.zeros(SOUND_RATE, np.int16), begin=0.1)
        editor.edit("a sound", lambda project: project.with_sounds(hum))
    if action.id.startswith("takes."):
        editor.edit("two takes", two_takes)
    if action.id == "clip.blend":
        workspace.actions.do("clip.split")
        editor.scrub(0.4)
    if action.id == "paint.clear":
        spot = editor.project.graph("post").positions[:1]
        editor.edit("paint", lambda project: paint_character(project, "post", spot, 0.3, "softer"))
    editor.select(**NEEDS.get(action.id, LIMB))
    if action.id == "motion.unkey":
        editor.scrub(0.5)
        workspace.commands.keys.set()


def two_takes(project: Project) -> Project:
    """Returns the limb's wave as a take with an alternative take."""
    shape = project.shape("limb")
    first = replace(shape.layers[0], recorded="take 1", alternatives="take 1")
    other = {"layer_id": "again", "muted": True, "recorded": "take 2", "alternatives": "take 1"}
    project = project.with_characters(shape.with_changes(layers=(first, *shape.layers[1:])))
    return bind_chain(project, "limb", (0, 1), "wave", (0, 1), **other)


def pixel_on(workspace: Workspace, name: str) -> tuple[float, float]:
    """Returns a pixel on the surface of a character."""
    posed, tool = workspace.editor.stage_character(name), workspace.input.tools["choose"]
    middles = posed.vertices[posed.character.mesh.faces].mean(1)
    for x, y in workspace.editor.lens.project_visible(middles[:: max(len(middles) // 60, 1)]):
        hit = tool.character_at(Pointer((x, y)))
        if hit is not None and hit.character == name and hit.handle < 0:
            return x, y
    raise AssertionError(f"{name} is not seen")
