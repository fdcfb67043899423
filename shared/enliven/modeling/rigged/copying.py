"""Shapes copied with their motion, mirrored and scaled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray
from enliven.document import Project, Shape, unused
from enliven.errors import InputError
from enliven.modeling.rigged.axes import Axes, layers_in
from enliven.modeling.rigged.bones import bones_of, rebuilt
from enliven.modeling.rigged.pasting import checked_shift, with_takes_of
from enliven.modeling.rigged.posed import with_travel_kept
from enliven.motion.layers import layers_of, without_idle_layers
from enliven.rotation import IDENTITY, normalized


def copy_shape(
    project: Project,
    shape_id: str,
    *,
    offset: AnyArray = (0.0, 0.0, 0.0),  # type: ignore[assignment]
    delay: float = 0.0,
) -> tuple[Project, str]:
    """A project with a copy of a shape, and the copy's id.

    The copy has layers of its own, so that its time, weight and basis can be changed alone; they refer to
    the same takes.

    Args:
        offset: (3,) metres from the shape to its copy.
        delay: seconds that the copy moves later.
    """
    return paste_shape(project, project, shape_id, offset=offset, delay=delay)


def paste_shape(
    project: Project,
    source: Project,
    shape_id: str,
    *,
    offset: AnyArray = (0.0, 0.0, 0.0),  # type: ignore[assignment]
    delay: float = 0.0,
) -> tuple[Project, str]:
    """A project with a copy of a shape of another project, with its motion, and the copy's id.

    Takes that the project has already, bit for bit, are used; others come along.

    Raises:
        InputError: where there is no such shape, or the offset or delay is no number.
    """
    shape = source.shape(shape_id)
    shift = checked_shift(offset, delay, f"shape {shape_id!r}")
    names = [source.layers[name].take for name in layers_of(shape)]
    project, takes = with_takes_of(project, source, names)
    ids: dict[str, str] = {}
    taken = dict.fromkeys(project.layers)
    made = []
    for name in layers_of(shape):
        layer = source.layers[name]
        ids[name] = unused(name, taken)
        taken[ids[name]] = None
        made.append(replace(layer, id=ids[name], take=takes[layer.take]).later(delay))
    copy_id = unused(shape_id, {**project.shapes, **project.graphs, **project.puppets})
    copy = _with_layers(shape, ids).with_changes(id=copy_id, place=shape.place + shift)
    return project.with_layers(*made).with_shapes(copy), copy_id


def mirror_shape(project: Project, shape_id: str, normal: AnyArray) -> Project:
    """A project with a shape mirrored in the plane through its root at right angles to ``normal`` (3,).

    At every time each joint is where the mirror shows it: the rest pose and the mesh are reflected, the
    modeling rotations and the layers conjugated by the reflection (M D M). A layer that other shapes use too
    is copied. To keep both, copy the shape first.

    Raises:
        InputError: where there is no such shape, or no direction.
    """
    shape = project.shape(shape_id)
    axes = Axes.mirror(normal)
    project, ids = layers_in(project, shape, axes)
    centre = shape.skeleton.positions[0]
    bones = [
        bone._replace(
            rest=centre + axes.vectors(bone.rest - centre) if bone.parent else bone.rest,
            modeling=normalized(axes.rotations(bone.modeling)),
            spans=axes.spans(bone.spans, ids),
        )
        for bone in bones_of(shape)
    ]
    mesh = shape.mesh
    if mesh is not None:
        # A reflection turns surfaces inside out; the other order of corners turns them back.
        vertices = centre + axes.vectors(mesh.vertices - centre)
        mesh = replace(mesh, vertices=vertices, faces=mesh.faces[:, ::-1])
    travel = ids.get(shape.travel, None) if shape.travel else None
    mirrored = rebuilt(shape, bones, mesh=mesh, travel=travel)
    return project.with_shapes(with_travel_kept(project, shape, mirrored))


def scale_shape(project: Project, shape_id: str, factor: float) -> Project:
    """A project with a shape ``factor`` times as large, about its root; turns stay, strides grow along.

    Raises:
        InputError: where there is no such shape, or the factor is not above zero.
    """
    shape = project.shape(shape_id)
    if not (np.isfinite(factor) and factor > 0.0):
        mend = "Give a number above 0; mirror_shape turns it over."
        raise InputError(f"it cannot be {factor} times as large", where=f"shape {shape_id!r}", mend=mend)
    centre = shape.skeleton.positions[0]
    bones = [bone._replace(rest=centre + factor * (bone.rest - centre)) for bone in bones_of(shape)]
    mesh = shape.mesh
    if mesh is not None:
        mesh = replace(mesh, vertices=centre + factor * (mesh.vertices - centre))
    stride = None if shape.travel_scale is None else shape.travel_scale * factor
    return project.with_shapes(rebuilt(shape, bones, mesh=mesh, travel_scale=stride))


def delete_shape(project: Project, shape_id: str) -> Project:
    """A project without a shape, nor the layers that only it used; the takes stay.

    Raises:
        InputError: where there is no such shape.
    """
    project.shape(shape_id)
    return without_idle_layers(project.without_shape(shape_id), project, shape_id)


def _with_layers(shape: Shape, ids: dict[str, str]) -> Shape:
    """The shape with other names for its layers."""
    spans = tuple(Axes(IDENTITY).spans(bone, ids) for bone in shape.spans)
    return shape.with_changes(spans=spans, travel=ids[shape.travel] if shape.travel else None)
