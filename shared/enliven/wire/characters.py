"""The message of a whole character."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from enliven.wire.fields import MAX_FACES, MAX_TRANSFORMS, MAX_VERTICES, Name, RevisionNumber, check_length

MAX_ITERATIONS = 100
"""Maximum number of solver iterations per frame. 3 are usual. A larger number from an untrusted sender would
overload a viewer.
"""
MAX_STIFFNESS = 1e6
"""Maximum weight of a position constraint, and maximum stretch. It is far above useful values, and limits
numbers from untrusted senders."""
MAX_SOLVED_VERTICES = 100_000
"""Maximum vertices of the solved mesh. 8,000 are usual. A larger number from an untrusted sender would
overload a viewer."""


MAX_MATERIALS = 1024
"""Maximum number of materials, and of textures, of a character. Detailed characters have dozens."""
MAX_DEFINITION = 16 * 1024
"""Maximum length of a material's JSON in characters. A material with many extensions has a few thousand
characters."""
MAX_TEXTURE_BYTES = 16 * 1024 * 1024
"""Maximum total size in bytes of a character's encoded textures. If they are larger, vertex colours are sent
instead."""
MAX_JOINT_NAME = 128
"""Maximum length of a joint's name in characters. Names built from paths and namespaces have about 60."""
JointName = Annotated[str, Meta(min_length=1, max_length=MAX_JOINT_NAME)]


class SurfaceMessage(Struct, frozen=True):
    """Settings of the solver that makes a surface follow control points, see
    :class:`enliven.deformation.arap.solver.ArapSettings`.

    The ranges exclude unreasonable values, so that an untrusted sender cannot overload a viewer.
    """

    iterations: Annotated[int, Meta(ge=1, le=MAX_ITERATIONS)] = 3
    squash_and_stretch: bool = True
    hold: Annotated[float, Meta(ge=0.0, le=MAX_STIFFNESS)] = 0.05
    exaggeration: Annotated[float, Meta(ge=0.0, le=5.0)] = 1.0
    most_stretch: Annotated[float, Meta(ge=1.0, le=MAX_STIFFNESS)] = 4.0
    follow: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.01
    volume: Annotated[float, Meta(ge=0.0, le=1.0)] = 1.0
    coarse_above: Annotated[int, Meta(ge=100, le=MAX_VERTICES)] = 12_000
    coarse_vertices: Annotated[int, Meta(ge=50, le=MAX_SOLVED_VERTICES)] = 8_000
    guide_vertices: Annotated[int, Meta(ge=20, le=MAX_SOLVED_VERTICES)] = 400


class TextureMessage(Struct, frozen=True):
    """An encoded image (PNG or JPEG) and the JSON of its glTF sampler."""

    image: Annotated[bytes, Meta(min_length=8, max_length=MAX_TEXTURE_BYTES)]
    sampler: Annotated[str, Meta(max_length=MAX_DEFINITION)] = ""


class MaterialsMessage(Struct, frozen=True):
    """The materials of a character's faces, as in :class:`enliven.meshes.MeshMaterials`.

    Attributes:
        definitions: JSON objects of glTF materials.
        of: (F,) int32 the material of each face, -1 for none.
        sets: number of sets of texture coordinates.
        uvs: (F, 3, S, 2) float32 texture coordinates.
        tints: (F, 3, 4) float32, or None for white.
    """

    definitions: Annotated[
        list[Annotated[str, Meta(max_length=MAX_DEFINITION)]], Meta(max_length=MAX_MATERIALS)
    ]
    textures: Annotated[list[TextureMessage], Meta(max_length=MAX_MATERIALS)]
    of: bytes
    sets: Annotated[int, Meta(ge=0, le=4)]
    uvs: bytes
    tints: bytes | None = None


class CharacterMessage(Struct, tag=True, frozen=True):
    """A complete character, the reply to :class:`GetState`.

    For receivers that may not support control points, the kind is "bones" with complete skin weights. They
    display the character as a rigid object.

    Attributes:
        kind: "graph", "bones" or "points". It is "points" only if skin weights are left out. A received
            character with ``held`` is always treated as kind "points".
        vertices: (V, 3) float32 metres.
        faces: (F, 3) int32.
        indices: (V, 4) uint16 transforms of the skin weights. Empty for kind "points": all vertices follow
            the first transform.
        weights: (V, 4) float32 skin weights. Empty for kind "points".
        pivots: (J, 3) float32 metres, the pivots of the transforms at rest.
        edges: (E, 2) int32 pairs of transforms to draw as lines.
        colours: (V, 3) uint8 sRGB, or None.
        held: (J - 1,) int32, for kind "points": the vertex that each transform except the first one moves.
        pulls: (J - 1,) float32, the stiffness of each constraint, 0 for hard constraints. None if all are
            hard.
        surface: settings of the surface solver. None means the defaults.
        names: (J,) names of the joints at the bones' ends. None if they have none.
        materials: materials with their textures. None if the character has only vertex colours.
        stiffness: (V,) float32 above 0, the painted stiffness of kind "graph". None for 1 everywhere.
    """

    id: Name
    revision: RevisionNumber
    kind: Literal["graph", "bones", "points"]
    vertex_count: Annotated[int, Meta(ge=1, le=MAX_VERTICES)]
    face_count: Annotated[int, Meta(ge=1, le=MAX_FACES)]
    pivot_count: Annotated[int, Meta(ge=1, le=MAX_TRANSFORMS)]
    edge_count: Annotated[int, Meta(ge=0, le=64 * MAX_TRANSFORMS)]
    vertices: bytes
    faces: bytes
    indices: bytes
    weights: bytes
    pivots: bytes
    edges: bytes
    colours: bytes | None = None
    held: bytes | None = None
    pulls: bytes | None = None
    surface: SurfaceMessage | None = None
    names: Annotated[list[JointName], Meta(max_length=MAX_TRANSFORMS)] | None = None
    materials: MaterialsMessage | None = None
    stiffness: bytes | None = None

    def __post_init__(self) -> None:
        check_length("vertices", self.vertices, 12 * self.vertex_count)
        check_length("faces", self.faces, 12 * self.face_count)
        skinned = 0 if self.kind == "points" and not self.indices else self.vertex_count
        check_length("indices", self.indices, 8 * skinned)
        check_length("weights", self.weights, 16 * skinned)
        check_length("pivots", self.pivots, 12 * self.pivot_count)
        check_length("edges", self.edges, 8 * self.edge_count)
        if self.colours is not None:
            check_length("colours", self.colours, 3 * self.vertex_count)
        if self.held is not None:
            check_length("held", self.held, 4 * (self.pivot_count - 1))
        if self.pulls is not None:
            check_length("pulls", self.pulls, 4 * (self.pivot_count - 1))
        if self.materials is not None:
            _check_materials(self.materials, self.face_count)
        if self.stiffness is not None:
            check_length("stiffness", self.stiffness, 4 * self.vertex_count)


def _check_materials(materials: MaterialsMessage, faces: int) -> None:
    """Raises ValueError if the arrays do not match the number of faces, or the textures are too large."""
    check_length("of", materials.of, 4 * faces)
    check_length("uvs", materials.uvs, 24 * faces * materials.sets)
    if materials.tints is not None:
        check_length("tints", materials.tints, 48 * faces)
    size = sum(len(texture.image) for texture in materials.textures)
    if size > MAX_TEXTURE_BYTES:
        raise ValueError(f"the textures have {size} bytes, but at most {MAX_TEXTURE_BYTES} bytes can be sent")
