"""A rigged shape: a skeleton with a skinned mesh. Takes drive its bones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from enliven.arrays import Float, Int32, freeze
from enliven.document.character import Character, SkinWeights
from enliven.document.layers import STILL, Layer, Span
from enliven.document.pin import Pin
from enliven.document.rig import RigBase
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.rotation import IDENTITY


@dataclass(frozen=True, eq=False)
class RiggedCharacter(RigBase):
    """A skeleton with its skinned mesh, its modeling rotations, and the layers that move it.

    The world rotation of bone j is D_j = D_parent m_j a_j(t). m_j is the *modeling rotation*, which posing,
    cutting and merging change. a_j(t) is the *animation rotation*, computed from the layers (AniMesh, section
    6). Both are in the axes of the rest pose. The root has D_0 = m_0 a_0(t).

    Attributes:
        id: its name in the project.
        skeleton: the joints at rest.
        modeling: (N, 4) unit quaternions m_j.
        spans: (N,) the parts of takes that move each bone; see :mod:`enliven.document.layers`.
        place: (3,) metres, displacement of the root joint from its rest position.
        travel: the id of the layer that also moves the root, or None. Each loop of the take continues where
            the previous one ended.
        mesh: the surface at rest, in the skeleton's frame, or None.
        skin: the bones that each vertex follows, or None without a mesh.
        travel_scale: metres that the root moves per metre of the take's root, or None for the ratio of the
            body sizes; see :mod:`enliven.motion.layers.travel`.
        pins: the feet that are locked while they stand; see :mod:`enliven.motion.contact.pin`.
        layers: the layers that spans and ``travel`` refer to. Unreferenced layers are dropped.

    Raises:
        InputError: if the attributes are inconsistent.
    """

    id: str
    skeleton: Skeleton
    modeling: Float
    spans: tuple[tuple[Span, ...], ...]
    place: Float
    travel: str | None = None
    mesh: Mesh | None = None
    skin: SkinWeights | None = None
    travel_scale: float | None = None
    pins: tuple[Pin, ...] = ()
    layers: tuple[Layer, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "modeling", "place")
        object.__setattr__(self, "spans", tuple(tuple(spans) for spans in self.spans))
        layer_ids = layer_ids_in_spans(self)
        layers = {layer.id: layer for layer in self.layers if layer.id in layer_ids}
        object.__setattr__(self, "layers", tuple(layers.values()))
        problem = _describe_problem(self)
        missing = [] if problem else [name for name in layer_ids if name not in layers]
        if missing:
            problem = f"the shape refers to the layer {missing[0]!r}, which does not exist"
        if problem:
            raise InputError(problem, where=f"shape {self.id!r}", remedy="Build the shape again.")

    def at_rest(self, mesh: Mesh | None) -> tuple[RiggedCharacter, tuple[()]]:
        """Returns the shape without motion, travel and pins."""
        spans = (STILL,) * len(self.skeleton)
        return self.with_changes(mesh=mesh, spans=spans, layers=(), travel=None, pins=(), root_layers=()), ()

    kind = "bones"
    jointed = True
    word = "shape"
    drawn_by = ("mesh", "skin", "skeleton")

    @property
    def handles(self) -> tuple[str, ...]:
        """The names of its joints."""
        return self.skeleton.names

    def find_skeleton(self) -> Skeleton:
        """Returns the skeleton."""
        return self.skeleton

    @property
    def keyable(self) -> int:
        """The number of bones."""
        return len(self.skeleton)

    @property
    def parents(self) -> Int32:
        """(N,) the parent of each joint, or -1 for the root."""
        return self.skeleton.parents

    def without_layer(self, number: int) -> RiggedCharacter:
        """Returns the shape without a layer, and without references to it."""
        if number >= len(self.layers):
            return super().without_layer(number)
        removed_id = self.layers[number].id
        spans = tuple(
            tuple(
                replace(span, refs=tuple(ref for ref in span.refs if ref.layer != removed_id))
                for span in spans
            )
            for spans in self.spans
        )
        return self.with_changes(spans=spans, travel=None if self.travel == removed_id else self.travel)

    def layer(self, layer_id: str) -> Layer:
        """Returns the layer with an id.

        Raises:
            InputError: if the layer does not exist. The message lists the existing layers.
        """
        for layer in self.layers:
            if layer.id == layer_id:
                return layer
        names = ", ".join(layer.id for layer in self.layers)
        advice = f"Known layers: {names}." if names else "Bind a take to a chain of the shape first."
        raise InputError(f"the shape has no layer {layer_id!r}", where=self.where, remedy=advice)

    def check(self, held: Mapping[str, Mapping[str, Any]]) -> None:
        """Raises InputError if a take does not exist, or lacks joints of a layer's chain."""
        super().check(held)
        for layer in self.layers:
            if max(layer.chain) >= len(held["takes"][layer.take].skeleton):
                raise InputError(
                    "the layer's chain refers to joints that the take does not contain",
                    where=f"layer {layer.id!r}",
                )


def layer_ids_in_spans(shape: RiggedCharacter) -> tuple[str, ...]:
    """Returns the ids of the layers to which the spans of a shape refer, without repetition. The travel layer
    comes last.
    """
    layer_ids = dict.fromkeys(ref.layer for spans in shape.spans for span in spans for ref in span.refs)
    if shape.travel is not None:
        layer_ids[shape.travel] = None
    return tuple(layer_ids)


def still_shape(
    id: str, skeleton: Skeleton, mesh: Mesh | None = None, skin: SkinWeights | None = None
) -> RiggedCharacter:
    """Returns a shape at rest without motion."""
    count = len(skeleton)
    return RiggedCharacter(
        id, skeleton, np.tile(IDENTITY, (count, 1)), (STILL,) * count, np.zeros(3), None, mesh, skin
    )


def character_of(shape: RiggedCharacter) -> Character:
    """Converts the shape to a character for viewers. Transform j is bone j, about the rest position of its
    parent joint.

    Raises:
        InputError: if the shape has no mesh.
    """
    if shape.mesh is None or shape.skin is None:
        raise InputError(
            "it has no mesh", where=f"shape {shape.id!r}", remedy="Give it one, or draw its bones."
        )
    skeleton = shape.skeleton
    parent_joints = np.maximum(skeleton.parents, 0)
    return Character(
        id=shape.id,
        vertices=shape.mesh.vertices.astype(np.float32),
        faces=shape.mesh.faces,
        skin=shape.skin,
        pivots=skeleton.positions[parent_joints].astype(np.float32),
        edges=bones_to_draw(skeleton),
        kind="bones",
        colours=shape.mesh.colours,
        names=skeleton.names,
        materials=shape.mesh.materials,
    )


def bones_to_draw(skeleton: Skeleton) -> Int32:
    """Returns (E, 2) pairs of transforms. The pivots of a pair are the two ends of a bone."""
    # The pivot of transform j is the parent joint. So a bone is drawn from its own pivot to the pivot of its
    # first child.
    pairs = [(j, below[0]) for j, below in enumerate(skeleton.children) if j > 0 and below]
    return np.array(pairs, np.int32).reshape(-1, 2)


def _describe_problem(shape: RiggedCharacter) -> str:
    count = len(shape.skeleton)
    if shape.modeling.shape != (count, 4) or len(shape.spans) != count or shape.place.shape != (3,):
        return (
            f"the arrays do not match: {count} joints, rotations {shape.modeling.shape}, spans of "
            f"{len(shape.spans)} bones"
        )
    if not np.allclose(np.linalg.norm(shape.modeling, axis=1), 1.0, atol=1e-6):
        return "a modelled rotation of a bone is not a unit quaternion"
    if shape.travel_scale is not None and not 0.0 <= shape.travel_scale < 1e6:
        return f"the travel scale {shape.travel_scale} of the shape is not valid"
    for name, spans in zip(shape.skeleton.names, shape.spans, strict=True):
        shares = [span.share for span in spans]
        if not shares or min(shares) < 0.0 or abs(sum(shares) - 1.0) > 1e-9:
            return f"the spans of bone {name!r} do not cover the whole bone"
    if (shape.mesh is None) != (shape.skin is None):
        return "a shape needs both a mesh and skin weights, or neither"
    if shape.mesh is not None and shape.skin is not None:
        if shape.skin.indices.shape != (len(shape.mesh.vertices), 4):
            return (
                f"the skin weights are for {len(shape.skin.indices)} vertices, but the mesh has "
                f"{len(shape.mesh.vertices)} vertices"
            )
        if shape.skin.indices.size and int(shape.skin.indices.max()) >= count:
            return f"a vertex refers to bone {int(shape.skin.indices.max())}, but only {count} bones exist"
    return ""
