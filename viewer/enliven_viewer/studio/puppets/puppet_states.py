"""The positions of a puppet's control points during playback, and the initial positions of a new key pose."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import ExampleCharacter, Project
from enliven.errors import EnlivenError
from enliven.examples.puppet_examples import find_missing_examples
from enliven.examples.puppet_motion import PuppetState, evaluate_state, solve_layer_motion
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.puppets.motion_solver import MotionSolver


def make_rest_state(puppet: ExampleCharacter) -> PuppetState:
    """Returns the rest state of a puppet, at its placement."""
    return PuppetState(puppet.rest, 0.0, np.zeros(3))


def find_playback_state(
    editor: Editor, solver: MotionSolver, puppet: ExampleCharacter
) -> tuple[ExampleCharacter, PuppetState]:
    """Returns the puppet and its state at the editor's time, or its rest state if it cannot move yet.

    While the newest motion is being solved, the previously solved version of the puppet is returned.
    """
    project, solved = solver.get_newest_solution(editor.project, puppet.id)
    if not solved.layers:
        return puppet, make_rest_state(puppet)
    try:
        state = evaluate_state(project, solved, editor.time)
    except EnlivenError:  # The examples panel reports this error.
        return puppet, make_rest_state(puppet)
    if solved.mesh is not puppet.mesh or solved.points != puppet.points:
        return solved, state
    return puppet, state


def find_start_places(project: Project, puppet: ExampleCharacter, take: str, time: float) -> Float:
    """Returns the initial positions of a new key pose at a time of a take, (P, 3) in metres of the mesh's
    frame.

    They come from the existing examples if the motion can be solved, otherwise from the last key pose.
    """
    start = np.array(puppet.poses[-1].places if puppet.poses else puppet.rest)
    for number, layer in enumerate(puppet.layers):
        if layer.take == take and not find_missing_examples(project, puppet):
            try:
                motion = solve_layer_motion(project, puppet, number)
            except EnlivenError:
                continue
            start[list(motion.points)] = motion.interpolate(time)[0]
            break
    return start
