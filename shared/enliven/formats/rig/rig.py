"""A rigged model: a shape with the clips from its file.

rig = read_gltf("horse.glb")
rig.shape        # enliven.document.rigged.Shape, at rest in its bind pose, metres, +Y up
rig.clips        # its own animations, on the same skeleton
rig.notes        # what was changed or left out, with its size
project, shape = play_clip(Project(), rig.shape, rig.clips[0])    # the shape plays its own clip
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Layer, Project, Ref, RiggedCharacter, Skeleton, SkinWeights, Span, unused
from enliven.errors import InputError
from enliven.meshes import Mesh


@dataclass(frozen=True, eq=False)
class Rig:
    """A model that was read from a file.

    Attributes:
        shape: the model at rest. Its skeleton has a bone for each link between joints of the file.
        clips: its animations on this skeleton.
        notes: a sentence for each unusual property of the file.
    """

    shape: RiggedCharacter
    clips: tuple[Clip, ...] = ()
    notes: tuple[str, ...] = ()


def scale_to_height(rig: Rig, height: float) -> Rig:
    """Returns the model scaled to ``height`` metres.

    Raises:
        InputError: if the model has no vertical extent, or the height is not above 0.
    """
    mesh = rig.shape.mesh
    points = rig.shape.skeleton.positions if mesh is None else mesh.vertices
    height_at_rest = float(np.ptp(points[:, 1]))
    if not (height > 0 and height_at_rest > 0):
        raise InputError(
            f"a model with a height of {height_at_rest:.3g} m cannot be scaled to {height} m",
            where=f"shape {rig.shape.id!r}",
        )
    return _scale_and_move(rig, height / height_at_rest, np.zeros(3))


def place_on_floor(rig: Rig) -> Rig:
    """Moves the model vertically so that its lowest vertex is at y = 0."""
    mesh = rig.shape.mesh
    points = rig.shape.skeleton.positions if mesh is None else mesh.vertices
    return _scale_and_move(rig, 1.0, np.array([0.0, -points[:, 1].min(), 0.0]))


def _scale_and_move(rig: Rig, scale: float, by: Float) -> Rig:
    """Returns the model scaled about the origin, then moved."""
    shape = rig.shape
    skeleton = replace(shape.skeleton, positions=shape.skeleton.positions * scale + by)
    mesh = shape.mesh
    if mesh is not None:
        mesh = replace(mesh, vertices=mesh.vertices * scale + by)
    clips = tuple(_resize_clip(c, skeleton, scale, by) for c in rig.clips)
    return replace(rig, shape=shape.with_changes(skeleton=skeleton, mesh=mesh), clips=clips)


def _resize_clip(clip: Clip, skeleton: Skeleton, scale: float, by: Float) -> Clip:
    offsets = None if clip.offsets is None else clip.offsets * scale
    fine = None if clip.fine is None else clip.fine.scale_and_move(scale, by)
    cubic = tuple(curve.scale_and_move(scale, by) for curve in clip.cubic)
    root = clip.root * scale + by
    return replace(clip, skeleton=skeleton, root=root, offsets=offsets, fine=fine, cubic=cubic)


def weld_shape(shape: RiggedCharacter) -> RiggedCharacter:
    """Merges vertices that have the same position and skin weights. Cuts and merges of shapes require this.

    In files with flat shading, faces do not share vertices. A merged vertex gets the colour of the first
    original vertex.
    """
    if shape.mesh is None or shape.skin is None:
        return shape
    mesh, skin = shape.mesh, shape.skin
    keys = np.concatenate([mesh.vertices + 0.0, skin.indices, np.round(skin.weights, 5)], 1)
    _, first_vertices, vertex_of = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first_vertices, kind="stable")
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    faces, first_vertices = number[vertex_of.ravel()][mesh.faces], first_vertices[order]
    is_usable = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])
    colours, stiffness = mesh.paint_at(first_vertices)
    materials = None if mesh.materials is None else mesh.materials.select_faces(is_usable)
    faces = faces[is_usable].astype(np.int32)
    welded_mesh = Mesh(mesh.vertices[first_vertices], faces, mesh.name, colours, materials, stiffness)
    return shape.with_changes(
        mesh=welded_mesh, skin=SkinWeights(skin.indices[first_vertices], skin.weights[first_vertices])
    )


def play_clip(project: Project, shape: RiggedCharacter, clip: Clip) -> tuple[Project, RiggedCharacter]:
    """Adds a shape to a project. All of its bones and its root play a clip that has the shape's own skeleton.

    Each bone gets a separate layer, for the chain from its parent joint to its joint. So each bone rotates,
    moves and stretches exactly as in the clip.

    Raises:
        InputError: if the clip has another skeleton.
    """
    skeleton = shape.skeleton
    if not np.array_equal(clip.skeleton.parents, skeleton.parents):
        raise InputError(
            "the clip has another skeleton than the character",
            where=f"clip {clip.id!r}",
            remedy="Retarget the clip.",
        )
    if clip.id not in project.takes:
        project = project.with_takes(clip)
    layers, spans = list[Layer](), list[tuple[Span, ...]]()
    used_names: dict[str, object] = dict(project.layer_names)
    for j, name in enumerate(skeleton.names):
        chain = (int(skeleton.parents[j]), j) if j else (0,)
        layer = Layer(unused(f"{clip.id}: {name}", used_names), clip.id, chain, stretch=clip.has_deformation)
        used_names[layer.id] = layer
        layers.append(layer)
        spans.append((Span(1.0, (Ref(layer.id, 0.0, 1.0),)),))
    playing_shape = shape.with_changes(spans=tuple(spans), travel=layers[0].id, layers=tuple(layers))
    return project.with_characters(playing_shape), playing_shape
