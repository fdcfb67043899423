"""A contact sheet of a puppet: a row of the performer above a row of the puppet, at the same times."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document import ExampleCharacter, Project, character_from_puppet
from enliven.examples.puppet_motion import (
    convert_to_world_frame,
    evaluate_state,
    loop_position,
    pose_of_state,
    solve_layer_motion,
)
from enliven.skeletons.facing import find_facing
from enliven_viewer.film.motion_sheet import CAMERA_AZIMUTH, MotionRow, make_performer_row, write_rows


def write_puppet_sheet(
    path: Path,
    project: Project,
    puppet: ExampleCharacter,
    span: tuple[float, float],
    *,
    frames: int = 6,
    size: tuple[int, int] = (420, 420),
) -> None:
    """Draws the sheet as PNG.

    Args:
        span: start and end in seconds of the project.
        frames: number of times, evenly distributed over the span.
        size: size of each image in pixels.

    Raises:
        InputError: if the puppet lacks an input that it needs to move, such as key poses.
        ResourceError: if OpenGL is missing, or the file cannot be written.
    """
    times = np.linspace(*span, frames)
    rows = [_make_performer_row(project, puppet, times), _make_puppet_row(project, puppet, times)]
    counts_text = f"{len(puppet.poses)} key poses, {len(puppet.points)} control points"
    write_rows(path, rows, times, puppet.id, f"{span[1] - span[0]:.1f} s, {counts_text}", size)


def _make_performer_row(project: Project, puppet: ExampleCharacter, times: Float) -> MotionRow:
    """Returns the row of the performer in the take that the lowest unmuted layer plays, at the frames that it
    plays.
    """
    number = next(n for n, layer in enumerate(puppet.layers) if not layer.muted)
    layer, motion = puppet.layers[number], solve_layer_motion(project, puppet, number)
    clip = project.takes[layer.take]
    seconds = [loop_position(layer, motion, time)[0] * clip.step for time in times]
    return make_performer_row(clip, find_facing(clip.skeleton), motion.travels, seconds)


def _make_puppet_row(project: Project, puppet: ExampleCharacter, times: Float) -> MotionRow:
    held_vertices, weights = zip(*((point.vertex, point.weight) for point in puppet.points), strict=True)
    surface = PuppetSurface(puppet.mesh, held_vertices, weights, puppet.surface)
    states = [evaluate_state(project, puppet, time) for time in times]
    surfaces = [
        convert_to_world_frame(puppet, state, surface.solve_from_rest(state.places)).astype(np.float32)
        for state in states
    ]
    poses = [pose_of_state(puppet, state) for state in states]
    return MotionRow(character_from_puppet(puppet), poses, CAMERA_AZIMUTH, surfaces)
