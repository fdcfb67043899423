"""Rigged models from glTF 2.0 (.gltf, .glb), as shapes with the clips that came with them.

The rest pose is the bind pose, in the world of the file (metres, +Y up). See ``rig_tree``
for how joints become bones. What an animation moves or scales a joint by is kept as the offsets and strains
of its clip; what no bone can follow is noted with its size.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.document import Clip, Skeleton, SkinWeights, still_shape, unused
from enliven.errors import EnlivenError
from enliven.files import DAMAGE
from enliven.formats.gltf.bind import Bind
from enliven.formats.gltf.bodies import bodies_of
from enliven.formats.gltf.file import GltfFile
from enliven.formats.gltf.materials import Materials
from enliven.formats.gltf.motion import MOST_PLACES, animated_locals, frame_times, world_matrices
from enliven.formats.gltf.parts import GltfPart, parts_of, shown_nodes
from enliven.formats.rig import (
    LinkBody,
    Rig,
    Tree,
    clip_tracks,
    joint_drift,
    on_floor,
    resized,
    tree_of,
    welded,
)
from enliven.meshes import Mesh, repaired, submesh

_TOLD = 1e-3
"""Share of the model's size above which a motion that was left out gets a note: less is not visible."""

_SAME_SIZE = 0.1
"""Share of its size by which a mesh may differ from the bind pose to be the same: poses differ in an arm."""
_MOST_JOINTS = 4096
"""As many as a pose on the wire has (:data:`enliven.wire.posecode.MAX_TRANSFORMS`)."""


@dataclass
class _Animation:
    """One animation: its name, its frames among those of all, and the seconds between them."""

    name: str
    frames: slice
    step: float


def read_gltf(
    path: Path | str, *, name: str = "", height: float | None = None, floor: bool = False, weld: bool = False
) -> Rig:
    """Reads a model from a glTF or GLB file.

    A model without a rig gets one bone, from the middle of its foot to the middle of its top.

    Args:
        name: the name for the shape; the file's name if empty.
        height: metres to scale the model to; None takes it as modelled.
        floor: put its lowest vertex on the floor.
        weld: join vertices of one place that follow the same bones; see ``welded``.

    Raises:
        InputError: where the file cannot be read, or has nothing to draw.
    """
    file = GltfFile(path)
    try:
        rig = _read(file, name or file.path.stem)
    except EnlivenError:
        raise
    except DAMAGE as error:
        logging.getLogger(__name__).debug("glTF", exc_info=True)
        raise file.wrong(f"it is damaged ({type(error).__name__}: {str(error)[:80]})") from None
    rig = resized(rig, height) if height is not None else rig
    rig = on_floor(rig) if floor else rig
    return Rig(welded(rig.shape), rig.clips, rig.notes) if weld else rig


def with_materials(mesh: Mesh, path: Path | str, bind_pose: bool = False) -> Mesh:
    """Returns a mesh that was loaded from a glTF file with the file's materials.

    It is unchanged where its faces are not among those that :func:`read_gltf` finds.

    Args:
        bind_pose: return a rigged model where its joints hold it, if its nodes alone lay it down or scale it.
    """
    own = read_gltf(path).shape.mesh
    if own is None:
        return mesh
    if bind_pose and not _is_alike(mesh, own):
        return repaired(own)
    if own.materials is None:
        return mesh
    # Vertices that no face uses are left out by one reader and not by the other.
    whole, bare = (submesh(one, np.ones(len(one.faces), bool)) for one in (own, mesh))
    if len(whole.vertices) != len(bare.vertices):
        return mesh
    number = {face: at for at, face in enumerate(map(tuple, whole.faces.tolist()))}
    faces = np.array([number.get(face, -1) for face in map(tuple, bare.faces.tolist())], np.int64)
    return mesh if (faces < 0).any() else replace(mesh, materials=own.materials.taken(faces))


def _is_alike(mesh: Mesh, own: Mesh) -> bool:
    """Whether a mesh has the size of the model in its bind pose, along all axes."""
    sizes = [np.ptp(one.vertices[np.unique(one.faces)], axis=0) for one in (mesh, own)]
    return bool(np.abs(sizes[0] - sizes[1]).max() <= _SAME_SIZE * sizes[1].max())


def _read(file: GltfFile, name: str) -> Rig:
    """Reads the model without scaling or moving it."""
    notes = list[str]()
    parts, materials = parts_of(file, notes)
    if not parts:
        raise file.wrong("there is no triangle in its scene")
    bind = Bind(file, parts)
    rest = [bind.vertices(part) for part in parts]
    mesh = _mesh(name, parts, rest, bind, materials)
    if all(part.skin < 0 for part in parts) and not file.document.animations:
        return _unrigged(name, mesh, notes)
    return _rigged(file, name, parts, rest, mesh, bind, notes)


def _mesh(name: str, parts: list[GltfPart], rest: list[Float], bind: Bind, materials: Materials) -> Mesh:
    """Joins all parts into one mesh; a mirrored part gets its faces turned round."""
    first = np.cumsum([0, *(len(v) for v in rest)])
    faces: list[Int32] = []
    for part in parts:
        node = part.nodes[0, 0] if len(part.nodes) else part.carrier
        inverse = np.eye(4) if part.skin < 0 else bind.inverse[part.skin][int(node)]
        mirrored = np.linalg.det((bind.world[node] @ inverse)[:3, :3]) < 0
        faces.append(part.faces[:, ::-1] if mirrored else part.faces)
    colours = np.concatenate([part.colours for part in parts])
    shown = [(own, part.material, part.corners) for own, part in zip(faces, parts, strict=True)]
    whole = np.concatenate([own + start for own, start in zip(faces, first[:-1], strict=True)])
    return Mesh(np.concatenate(rest), whole.astype(np.int32), name, colours, materials.joined(shown))


def _unrigged(name: str, mesh: Mesh, notes: list[str]) -> Rig:
    low, high = mesh.bounds
    middle = (low + high) / 2
    foot, top = np.array([middle[0], low[1], middle[2]]), np.array([middle[0], high[1], middle[2]])
    skeleton = Skeleton(("foot", "top"), np.array([-1, 0], np.int32), np.stack([foot, top]))
    indices = np.tile(np.array([1, 0, 0, 0], np.uint16), (len(mesh.vertices), 1))
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(mesh.vertices), 1))
    shape = still_shape(name, skeleton, mesh, SkinWeights(indices, weights))
    return Rig(shape, (), (*notes, "it has no rig: it is given one bone, from its foot to its top"))


def _rigged(
    file: GltfFile,
    name: str,
    parts: list[GltfPart],
    rest: list[Float],
    mesh: Mesh,
    bind: Bind,
    notes: list[str],
) -> Rig:
    animations, world = _played(file)
    chosen = _chosen(file, parts)
    if len(chosen) > _MOST_JOINTS:
        raise file.wrong(f"it has {len(chosen)} joints, and no more than {_MOST_JOINTS} can move")
    size = float(np.ptp(mesh.vertices, axis=0).max())
    bodies = bodies_of(file, chosen, parts, rest, bind, world)
    ours = (file.document.asset.generator or "").startswith("enliven ")
    tree = tree_of(bodies, size, ours)
    body_of = {node: number for number, node in enumerate(chosen)}
    skin = _skin(parts, tree, body_of)
    shape = still_shape(name, tree.skeleton, mesh, skin)
    clips, taken = [], set[str]()
    tracks = clip_tracks(bodies, tree, size)
    for animation in animations:
        clips.append(_clip(animation, tree, bodies, tracks, taken))
    notes += tree.notes + _told(bodies, tree, size)
    return Rig(shape, tuple(clips), tuple(dict.fromkeys(notes)))


def _played(file: GltfFile) -> tuple[list[_Animation], Float]:
    """The animations, and (F, n, 4, 4) world_from_node over all their frames."""
    animations, worlds, start = list[_Animation](), list[Float](), 0
    for number, animation in enumerate(file.document.animations or []):
        times = frame_times(file, number)
        if (start + len(times)) * len(file.parents) > MOST_PLACES:
            raise file.wrong(f"its animations are more than {start + len(times)} frames together: too many")
        step = float(times[1] - times[0]) if len(times) > 1 else 1 / 30
        worlds.append(world_matrices(file, animated_locals(file, number, times)))
        name = animation.name or f"animation {number + 1}"
        animations.append(_Animation(name, slice(start, start + len(times)), step))
        start += len(times)
    count = len(file.document.nodes)
    return animations, np.concatenate(worlds) if worlds else np.zeros((0, count, 4, 4))


def _chosen(file: GltfFile, parts: list[GltfPart]) -> list[int]:
    """Returns the nodes that may be joints, parents before children: those of the used skins, those that
    carry a mesh stiffly, and animated nodes between them."""
    named = {int(n) for p in parts if p.skin >= 0 for n in file.document.skins[p.skin].joints}
    named |= {part.carrier for part in parts if part.skin < 0}
    animated = {c.target.node for a in file.document.animations or [] for c in a.channels}
    between = set[int]()
    for node in named:
        at, way = file.parents[node], list[int]()
        while at >= 0:
            way.append(at)
            if at in named:
                between |= set(way)
                break
            at = file.parents[at]
    return [n for n in shown_nodes(file) if n in named or (n in between and n in animated)]


def _skin(parts: list[GltfPart], tree: Tree, body_of: dict[int, int]) -> SkinWeights:
    """Returns four bones a vertex, for the joints that it follows in the file."""
    nodes: Int = np.concatenate([part.nodes for part in parts])
    weights = np.concatenate([part.weights for part in parts])
    bone = np.zeros(max(body_of) + 1, np.uint16)
    for node, body in body_of.items():
        bone[node] = tree.bone.get(body, 0)
    return SkinWeights(bone[nodes], weights.astype(np.float32))


def _clip(
    animation: _Animation,
    tree: Tree,
    bodies: list[LinkBody],
    tracks: tuple[Float | None, Float | None],
    taken: set[str],
) -> Clip:
    """One animation; ``tracks`` are the offsets and strains of all of them, kept where this one has any."""
    name = unused(animation.name, taken)
    taken.add(name)
    turns = np.stack([bodies[k].turns[animation.frames] for k in tree.driver], 1)
    own = [None if track is None else track[animation.frames] for track in tracks]
    offsets, strains = (None if track is None or not track.any() else track for track in own)
    root = bodies[tree.root].places[animation.frames]
    return Clip(name, tree.skeleton, turns, root, animation.step, offsets=offsets, strains=strains)


def _told(bodies: list[LinkBody], tree: Tree, size: float) -> list[str]:
    """Returns notes on what in the animations no bone follows, with its size."""
    away = [(name, far) for name, far in joint_drift(bodies, tree) if far > _TOLD * size]
    if not away:
        return []
    name, far = max(away, key=lambda pair: pair[1])
    what = f"animations move {len(away)} joint{'s' * (len(away) > 1)} off their bones; not kept"
    return [f"{what}: at most {far:.3g} m ({far / size:.1%} of the size), {name}"]
