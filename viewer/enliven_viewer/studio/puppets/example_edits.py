"""Edits of the examples panel that combine several calls of :mod:`enliven.modeling.puppet.edits`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from enliven.document import Coupling, ExampleCharacter, Kind, Position, Project, Switch, Velocity, unused
from enliven.errors import InputError
from enliven.meshes import fit_height
from enliven.modeling.edits import change_layers
from enliven.modeling.puppet.points import add_point, change_point
from enliven.modeling.puppet.poses import add_key_pose, change_key_pose, mirror_key_pose
from enliven.modeling.puppet.suggest import suggest_pairs
from enliven_viewer.language import tr

_AUTOMATIC_NAME = re.compile(r"point \d+")
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")
_IGNORED_WORDS = {"end", "index", "base", "tip", "joint", "site"}
HardConstraint = Position | Velocity | Coupling


def with_guessed_joints(project: Project, puppet_id: str, take: str) -> Project:
    """Returns a project in which each control point without a joint follows the most likely joint of a take.

    Points with an automatic name are renamed after their joint. Low points that follow feet are marked as
    feet.
    """
    puppet = project.puppet(puppet_id)
    if take not in project.takes:
        raise InputError(
            tr("no take is shown"), where="joints", remedy=tr("Choose a take in the performer's view.")
        )
    for pair in suggest_pairs(project, puppet_id, take):
        number = puppet.index(pair.point)
        project = with_joint(project, puppet_id, pair.point, pair.joint)
        if pair.foot:
            name = project.puppet(puppet_id).points[number].name
            project = change_point(project, puppet_id, name, foot=True)
    return project


def with_joint(project: Project, puppet_id: str, point: str, joint: str) -> Project:
    """Returns a project with a control point paired with a joint.

    An automatic name is replaced by the joint's name.
    """
    names = {control_point.name: control_point for control_point in project.puppet(puppet_id).points}
    name = unused(describe_joint(joint), names) if _AUTOMATIC_NAME.fullmatch(point) else point
    return change_point(project, puppet_id, point, joint=joint, name=name)


def describe_joint(joint: str) -> str:
    """Returns a joint's name in plain words: "LeftHandIndex1 end" becomes "left hand"."""
    words = [word.lower() for word in _WORD.findall(joint)]
    used_words = [word for word in words if word not in _IGNORED_WORDS]
    sides = [word for word in used_words if word in ("left", "right")]
    return " ".join([*sides, *(word for word in used_words if word not in sides)]) or joint.lower() or "point"


def turn_quarter(project: Project, puppet_id: str, axis: str) -> Project:
    """Returns a project with a puppet's mesh turned by 90 degrees in its own frame.

    The mesh is put on the floor again.

    Args:
        axis: "x" turns forward to up, for meshes from programs with z up. "y" turns its left side to the
            front.

    Raises:
        InputError: if it has control points, because turning it would invalidate its examples.
    """
    puppet = project.puppet(puppet_id)
    if puppet.points:
        remedy = tr("Turn the puppet with Ctrl+Left and Ctrl+Right, or remove its control points first.")
        raise InputError(
            tr("the puppet already has control points"), where=f"puppet {puppet_id!r}", remedy=remedy
        )
    x, y, z = puppet.mesh.vertices.T
    turned = np.stack([x, z, -y] if axis == "x" else [-z, y, x], axis=1)
    height = float(np.ptp(turned[:, 1]))
    mesh = fit_height(replace(puppet.mesh, vertices=turned), height)
    return project.with_characters(puppet.with_changes(mesh=mesh))


def with_points(project: Project, puppet_id: str, vertices: Sequence[int]) -> Project:
    """Returns a project with control points added at those vertices that have no control point."""
    for vertex in vertices:
        if all(point.vertex != vertex for point in project.puppet(puppet_id).points):
            project = add_point(project, puppet_id, int(vertex))
    return project


def duplicate_pose(project: Project, puppet_id: str, number: int, take: str, time: float) -> Project:
    """Returns a project with a copy of a key pose at another time."""
    return add_key_pose(project, puppet_id, take, time, project.puppet(puppet_id).poses[number].places)


def mirror_pose(project: Project, puppet_id: str, number: int, take: str, time: float) -> Project:
    """Returns a project with the mirror image of a key pose at another time."""
    project = duplicate_pose(project, puppet_id, number, take, time)
    return mirror_key_pose(project, puppet_id, len(project.puppet(puppet_id).poses) - 1)


def retime_pose(project: Project, puppet_id: str, number: int, time: float) -> Project:
    """Returns a project with a key pose moved to another frame of its take."""
    take = project.takes[project.puppet(puppet_id).poses[number].take]
    frame = int(np.clip(round(time / take.step), 0, len(take.turns) - 1))
    return change_key_pose(project, puppet_id, number, time=frame * take.step)


def with_setting(project: Project, puppet_id: str, group: str, name: str, value: Any) -> Project:
    """Returns a project with one setting of a puppet changed.

    ``group`` is "examples", "surface" or "locomotion".
    """
    puppet = project.puppet(puppet_id)
    return project.with_characters(
        puppet.with_changes(**{group: replace(getattr(puppet, group), **{name: value})})
    )


def with_default_settings(project: Project, puppet_id: str) -> Project:
    """Returns a project with a puppet's settings reset to the defaults."""
    puppet = project.puppet(puppet_id)
    plain = {name: type(getattr(puppet, name))() for name in ("examples", "surface", "locomotion")}
    return project.with_characters(puppet.with_changes(**plain))


def list_constraints(project: Project, puppet_id: str, layer: int) -> tuple[HardConstraint, ...]:
    """Returns the hard constraints of a layer, sorted by frame."""
    puppet_layer = project.puppet(puppet_id).layers[layer]
    return tuple(
        sorted(
            (*puppet_layer.positions, *puppet_layer.velocities, *puppet_layer.couplings),
            key=lambda held: held.frame,
        )
    )


def describe_constraint(held: HardConstraint, step: float) -> str:
    """Returns a short description of a hard constraint."""
    time_text = f"{held.frame * step:.2f} s"
    if isinstance(held, Position):
        return tr("{0} is fixed at a place at {1}", held.point, time_text)
    if isinstance(held, Velocity):
        return tr("{0} does not move at {1}", held.point, time_text)
    return tr("{0} is as high as {1} at {2}", held.point, held.other, time_text)


def with_constraint(project: Project, puppet_id: str, layer: int, held: HardConstraint) -> Project:
    """Returns a project with a hard constraint added.

    It replaces one of its kind at the same point and frame.
    """
    name, kept_constraints = _split_constraints(project, puppet_id, layer, held)
    return change_layers(project, puppet_id, [layer], **{name: (*kept_constraints, held)})


def remove_constraint_from(project: Project, puppet_id: str, layer: int, held: HardConstraint) -> Project:
    """Returns a project without a hard constraint."""
    name, kept_constraints = _split_constraints(project, puppet_id, layer, held)
    return change_layers(project, puppet_id, [layer], **{name: kept_constraints})


def _split_constraints(
    project: Project, puppet_id: str, layer: int, held: HardConstraint
) -> tuple[str, tuple[HardConstraint, ...]]:
    """Returns the layer's field for this kind of constraint, and its other constraints."""
    name = {Position: "positions", Velocity: "velocities", Coupling: "couplings"}[type(held)]
    other = getattr(held, "other", "")

    def about(constraint: HardConstraint) -> tuple[str, int, str]:
        return constraint.point, constraint.frame, getattr(constraint, "other", "")

    constraints: tuple[HardConstraint, ...] = getattr(project.puppet(puppet_id).layers[layer], name)
    return name, tuple(
        constraint for constraint in constraints if about(constraint) != (held.point, held.frame, other)
    )


def move_switch(switches: Sequence[Switch], number: int, frame: int, frames: int) -> tuple[Switch, ...]:
    """Returns the switches with one moved to another frame between its neighbours.

    The first stays at frame 0.
    """
    if number == 0:
        return tuple(switches)
    low = switches[number - 1].frame + 1
    high = switches[number + 1].frame - 1 if number + 1 < len(switches) else frames - 1
    moved_switch = replace(switches[number], frame=int(np.clip(frame, low, max(low, high))))
    return (*switches[:number], moved_switch, *switches[number + 1 :])


def add_switch(switches: Sequence[Switch], frame: int, frames: int) -> tuple[Switch, ...]:
    """Returns the switches with one added at a frame. From this frame, the kind of phase is reversed until
    the next switch.

    This splits a phase into three: the old kind, the opposite kind, and the old kind again. The opposite
    phase lasts a fortieth of all frames, but at least 3 frames and at most until the next switch.
    """
    frames_of_switches = [switch.frame for switch in switches]
    if frame in frames_of_switches or not 0 < frame < frames:
        return tuple(switches)
    number = max(k for k, switch_frame in enumerate(frames_of_switches) if switch_frame < frame)
    kind: Kind = switches[number].kind
    opposite: Kind = "flight" if kind == "contact" else "contact"
    end = frames_of_switches[number + 1] if number + 1 < len(frames_of_switches) else frames
    back = min(frame + max(frames // 40, 3), end)
    added_switches = [Switch(frame, opposite)]
    if back < end:
        added_switches.append(Switch(back, kind))
        return (*switches[: number + 1], *added_switches, *switches[number + 1 :])
    return (*switches[: number + 1], *added_switches, *switches[number + 2 :])


def remove_switch(switches: Sequence[Switch], number: int) -> tuple[Switch, ...]:
    """Returns the switches without switch ``number`` and the switch after it, so that the kinds still
    alternate.
    """
    if number == 0:
        return tuple(switches)
    return (
        (*switches[:number], *switches[number + 2 :])
        if number + 1 < len(switches)
        else tuple(switches[:number])
    )


def find_layer_number(puppet: ExampleCharacter, chosen: int | None, take: str = "") -> int | None:
    """Returns the number of the selected layer, or of the first unmuted one.

    A non-empty ``take`` restricts the search to layers of that take.
    """
    numbers = [k for k, layer in enumerate(puppet.layers) if take in ("", layer.take)]
    if chosen in numbers:
        return chosen
    return next((k for k in numbers if not puppet.layers[k].muted), next(iter(numbers), None))
