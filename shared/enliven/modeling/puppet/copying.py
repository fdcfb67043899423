"""Puppets copied, moved, scaled and mirrored, with their motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Plane, Project, Puppet, PuppetLayer, unused
from enliven.errors import InputError
from enliven.modeling.rigged import Axes, checked_motion, checked_shift, moved_mesh, with_takes_of
from enliven.rotation import IDENTITY, multiply, normalized, rotate


def copy_puppet(
    project: Project,
    puppet_id: str,
    *,
    offset: AnyArray = (0.0, 0.0, 0.0),  # type: ignore[assignment]
    delay: float = 0.0,
) -> tuple[Project, str]:
    """A project with a copy of a puppet, and the copy's id; it plays the same takes.

    Args:
        offset: (3,) metres from the puppet to its copy.
        delay: seconds that the copy moves later.
    """
    return paste_puppet(project, project, puppet_id, offset=offset, delay=delay)


def paste_puppet(
    project: Project,
    source: Project,
    puppet_id: str,
    *,
    offset: AnyArray = (0.0, 0.0, 0.0),  # type: ignore[assignment]
    delay: float = 0.0,
) -> tuple[Project, str]:
    """A project with a copy of a puppet of another project, with its examples and motion, and the copy's id.

    Takes that the project has already, bit for bit, are used; others come along.

    Raises:
        InputError: where there is no such puppet, or the offset or delay is no number.
    """
    puppet = source.puppet(puppet_id)
    shift = checked_shift(offset, delay, _where(puppet_id))
    takes = [*(pose.take for pose in puppet.poses), *(layer.take for layer in puppet.layers)]
    project, ids = with_takes_of(project, source, takes)
    copy_id = unused(puppet_id, {**project.shapes, **project.graphs, **project.puppets})
    copy = puppet.with_changes(
        id=copy_id,
        place=puppet.place + shift,
        poses=tuple(replace(pose, take=ids[pose.take]) for pose in puppet.poses),
        layers=tuple(replace(layer, take=ids[layer.take]).later(delay) for layer in puppet.layers),
    )
    return project.with_puppets(copy), copy_id


def move_puppet(
    project: Project,
    puppet_id: str,
    offset: AnyArray,
    turn: AnyArray = IDENTITY,
    about: AnyArray | None = None,
) -> Project:
    """A project with a puppet moved at every time: x becomes turn (x - about) + about + offset.

    Args:
        offset: (3,) metres.
        turn: (4,) rotation.
        about: (3,) metres that the turn leaves; None the origin.

    Raises:
        InputError: where there is no such puppet, or a number is not finite.
    """
    puppet = project.puppet(puppet_id)
    offset, turn, centre = checked_motion(offset, turn, about, _where(puppet_id))
    place = rotate(turn, puppet.place - centre) + centre + offset
    return project.with_puppets(
        puppet.with_changes(turn=normalized(multiply(turn, puppet.turn)), place=place)
    )


def turn_puppet(project: Project, puppet_id: str, turn: AnyArray) -> Project:
    """A project with a puppet turned by a rotation (4,) about where it stands.

    Raises:
        InputError: where there is no such puppet, or the turn is no unit quaternion.
    """
    return move_puppet(project, puppet_id, np.zeros(3), turn, _stands(project.puppet(puppet_id)))


def scale_puppet(project: Project, puppet_id: str, factor: float) -> Project:
    """A project with a puppet ``factor`` times as large where it stands; examples and strides grow along.

    Raises:
        InputError: where there is no such puppet, or the factor is not above zero.
    """
    puppet = project.puppet(puppet_id)
    if not (np.isfinite(factor) and factor > 0.0):
        mend = "Give a number above 0; mirror_puppet turns it over."
        raise InputError(f"it cannot be {factor} times as large", where=_where(puppet_id), mend=mend)

    def scaled(vectors: AnyArray) -> Float:
        return np.asarray(vectors, np.float64) * factor

    stood = _stands(puppet)
    made = puppet.with_changes(
        mesh=replace(puppet.mesh, vertices=scaled(puppet.mesh.vertices)),
        poses=tuple(replace(pose, places=scaled(pose.places)) for pose in puppet.poses),
        layers=tuple(_mapped(layer, scaled) for layer in puppet.layers),
    )
    if puppet.symmetry is not None:
        made = made.with_changes(
            symmetry=Plane(_three(scaled(np.array(puppet.symmetry.point))), puppet.symmetry.normal)
        )
    return project.with_puppets(made.with_changes(place=puppet.place + stood - _stands(made)))


def mirror_puppet(project: Project, puppet_id: str, normal: AnyArray) -> Project:
    """A project with a puppet mirrored, at every time, in the plane where it stands across ``normal`` (3,).

    To keep both, copy the puppet first.

    Raises:
        InputError: where there is no such puppet, or no direction.
    """
    puppet = project.puppet(puppet_id)
    axes, flip = Axes.mirror(normal), Axes(IDENTITY, True)
    # M T (Ry(yaw) x + root) = (M T S) (Ry(-yaw) S x + S root), S the reflection in the plane x = 0.
    turn = normalized(multiply(axes.turn, flip.rotations(puppet.turn)))
    stood = _stands(puppet)
    made = puppet.with_changes(
        mesh=moved_mesh(puppet.mesh, np.zeros(3), flip, np.zeros(3)),
        poses=tuple(replace(pose, places=flip.vectors(pose.places)) for pose in puppet.poses),
        layers=tuple(
            replace(_mapped(layer, flip.vectors), mirrored=not layer.mirrored) for layer in puppet.layers
        ),
        turn=turn,
        place=stood + axes.vectors(puppet.place - stood),
    )
    if puppet.symmetry is not None:
        plane = Plane(
            _three(flip.vectors(np.array(puppet.symmetry.point))),
            _three(flip.vectors(np.array(puppet.symmetry.normal))),
        )
        made = made.with_changes(symmetry=plane)
    return project.with_puppets(made)


def delete_puppet(project: Project, puppet_id: str) -> Project:
    """A project without a puppet; the takes stay.

    Raises:
        InputError: where there is no such puppet.
    """
    project.puppet(puppet_id)
    return project.without_puppet(puppet_id)


def _where(puppet_id: str) -> str:
    return f"puppet {puppet_id!r}"


def _stands(puppet: Puppet) -> Float:
    """(3,) metres in the world, on the floor under the middle of the mesh at rest."""
    low, high = puppet.mesh.bounds
    middle = (low + high) / 2.0 * [1.0, 0.0, 1.0]
    return np.asarray(rotate(puppet.turn, middle) + puppet.place)


def _mapped(layer: PuppetLayer, map_of: Callable[[AnyArray], Float]) -> PuppetLayer:
    """A layer with its constraints in other axes or sizes; these keep each axis by itself."""
    return replace(
        layer,
        positions=tuple(replace(one, place=_three(map_of(np.array(one.place)))) for one in layer.positions),
        velocities=tuple(
            replace(one, velocity=_three(map_of(np.array(one.velocity)))) for one in layer.velocities
        ),
        couplings=tuple(replace(one, apart=_three(map_of(np.array(one.apart)))) for one in layer.couplings),
    )


def _three(vector: AnyArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z
