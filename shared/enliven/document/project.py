"""The project: shapes, takes and layers. It is a value: an edit makes another, and undo is the one before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import MappingProxyType

import numpy as np

from enliven.document.clip import Clip
from enliven.document.layers import Layer
from enliven.document.possessed import GraphShape, PoseStream
from enliven.document.puppet import Puppet
from enliven.document.rigged import Shape
from enliven.errors import InputError


@dataclass(frozen=True, eq=False)
class Project:
    """All shapes, takes and layers by id. Takes never change; a layer refers to one, a shape to layers.

    Possessed meshes (graphs) play pose streams, which never change either; puppets play takes, by examples.

    Raises:
        InputError: where a shape names a layer, a layer or a puppet a take, or a graph a stream, that is not
            there.
    """

    shapes: Mapping[str, Shape] = field(default_factory=dict)
    takes: Mapping[str, Clip] = field(default_factory=dict)
    layers: Mapping[str, Layer] = field(default_factory=dict)
    graphs: Mapping[str, GraphShape] = field(default_factory=dict)
    streams: Mapping[str, PoseStream] = field(default_factory=dict)
    puppets: Mapping[str, Puppet] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("shapes", "takes", "layers", "graphs", "streams", "puppets"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        for layer in self.layers.values():
            if layer.take not in self.takes:
                raise InputError(f"there is no take {layer.take!r}", where=f"layer {layer.id!r}")
            if max(layer.chain) >= len(self.takes[layer.take].skeleton):
                raise InputError("its chain names joints that the take lacks", where=f"layer {layer.id!r}")
        for shape in self.shapes.values():
            named = {ref.layer for spans in shape.spans for span in spans for ref in span.refs}
            missing = (named | ({shape.travel} if shape.travel else set())) - set(self.layers)
            if missing:
                raise InputError(f"there is no layer {min(missing)!r}", where=f"shape {shape.id!r}")
        for graph in self.graphs.values():
            where = f"graph shape {graph.id!r}"
            for part in graph.parts:
                if part.stream not in self.streams:
                    raise InputError(f"there is no stream {part.stream!r}", where=where)
                known = self.streams[part.stream].positions.shape[1]
                if part.nodes.size and not 0 <= part.nodes.min() <= part.nodes.max() < known:
                    raise InputError(f"it plays nodes of {part.stream!r} that are not there", where=where)
        for puppet in self.puppets.values():
            takes = {layer.take for layer in puppet.layers} | {pose.take for pose in puppet.poses}
            if takes - set(self.takes):
                what = f"there is no take {min(takes - set(self.takes))!r}"
                raise InputError(what, where=f"puppet {puppet.id!r}")

    def with_shapes(self, *shapes: Shape) -> Project:
        """A project with these shapes added, or put in the place of those of the same id."""
        return replace(self, shapes={**self.shapes, **{shape.id: shape for shape in shapes}})

    def without_shape(self, shape_id: str) -> Project:
        """A project without a shape; its layers and takes stay."""
        return replace(self, shapes={k: v for k, v in self.shapes.items() if k != shape_id})

    def with_takes(self, *takes: Clip) -> Project:
        """A project with these takes added."""
        return replace(self, takes={**self.takes, **{take.id: take for take in takes}})

    def with_layers(self, *layers: Layer) -> Project:
        """A project with these layers added, or put in the place of those of the same id."""
        return replace(self, layers={**self.layers, **{layer.id: layer for layer in layers}})

    def with_graphs(self, *graphs: GraphShape) -> Project:
        """A project with these possessed meshes added, or put in the place of those of the same id."""
        return replace(self, graphs={**self.graphs, **{graph.id: graph for graph in graphs}})

    def without_graph(self, shape_id: str) -> Project:
        """A project without a possessed mesh; its streams stay."""
        return replace(self, graphs={k: v for k, v in self.graphs.items() if k != shape_id})

    def with_streams(self, *streams: PoseStream) -> Project:
        """A project with these pose streams added."""
        return replace(self, streams={**self.streams, **{stream.id: stream for stream in streams}})

    def with_puppets(self, *puppets: Puppet) -> Project:
        """A project with these puppets added, or put in the place of those of the same id."""
        return replace(self, puppets={**self.puppets, **{puppet.id: puppet for puppet in puppets}})

    def without_puppet(self, puppet_id: str) -> Project:
        """A project without a puppet; the takes that it played stay."""
        return replace(self, puppets={k: v for k, v in self.puppets.items() if k != puppet_id})

    def puppet(self, puppet_id: str) -> Puppet:
        """The puppet of an id.

        Raises:
            InputError: where there is none, with the ids that there are.
        """
        if puppet_id not in self.puppets:
            mend = f"Known: {', '.join(self.puppets)}." if self.puppets else "Make one of a mesh first."
            raise InputError(f"there is no puppet {puppet_id!r}", where="project", mend=mend)
        return self.puppets[puppet_id]

    def graph(self, shape_id: str) -> GraphShape:
        """The possessed mesh of an id.

        Raises:
            InputError: where there is none, with the ids that there are.
        """
        if shape_id not in self.graphs:
            mend = f"Known: {', '.join(self.graphs)}." if self.graphs else "Possess a mesh first."
            raise InputError(f"there is no graph shape {shape_id!r}", where="project", mend=mend)
        return self.graphs[shape_id]

    def shape(self, shape_id: str) -> Shape:
        """The shape of an id.

        Raises:
            InputError: where there is none, with the ids that there are.
        """
        if shape_id not in self.shapes:
            mend = f"Known: {', '.join(self.shapes)}." if self.shapes else "Add one first."
            raise InputError(f"there is no shape {shape_id!r}", where="project", mend=mend)
        return self.shapes[shape_id]


def unused(stem: str, taken: Mapping[str, object]) -> str:
    """``stem``, or ``stem 2``, ``stem 3``, ...: the first that is not taken."""
    number, name = 1, stem
    while name in taken:
        number += 1
        name = f"{stem} {number}"
    return name


def same(a: object, b: object) -> bool:
    """Whether two projects, or two parts of them, are the same value, bit for bit.

    Arrays are the same with the same type, shape and bytes; so -0.0 is not 0.0, and a NaN is itself.
    """
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if is_dataclass(a):
        return all(same(getattr(a, part.name), getattr(b, part.name)) for part in fields(a))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float) and isinstance(b, float):
        return a.hex() == b.hex()
    return bool(a == b)
