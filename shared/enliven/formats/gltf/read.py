"""Reads rigged models from glTF 2.0 files (.gltf, .glb) as shapes, including the animation clips.

The rest pose is the bind pose, in the world of the file (metres, +Y up). Module ``rig_tree`` describes the
conversion of joints to bones. Translations and scales of joints in an animation become the offsets and
strains of its clip. If bones cannot reproduce a motion, a note reports its size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import Clip, FineFrames, Skeleton, SkinWeights, still_shape, unused
from enliven.errors import EnlivenError
from enliven.files import DAMAGE
from enliven.formats.gltf.bodies import measure_bodies
from enliven.formats.gltf.cubic import add_cubic_keys
from enliven.formats.rig.rig import Rig, place_on_floor, scale_to_height, weld_shape
from enliven.formats.rig.rig_links import LinkBody
from enliven.formats.rig.rig_tree import Tree, build_tree, clip_tracks, joint_drift
from enliven.meshes import Mesh
from enliven.meshes.gltf.file import GltfFile
from enliven.meshes.gltf.motion import (
    MAX_NODE_SAMPLES,
    frame_times,
    key_times,
    sample_animated_locals,
    world_matrices,
)
from enliven.meshes.gltf.parts import GltfPart, find_moving_nodes
from enliven.meshes.gltf.surface import GltfSurface, gltf_surface
from enliven.rotation import remove_sign_jumps

NO_RIG_NOTE = "the model has no rig, so one bone from its bottom to its top was added"
"""Note about a file that contains only a surface."""
_MIN_NOTED_MOTION_FRACTION = 1e-3
"""Minimum size of omitted motion that is reported in a note, as a fraction of the model's size. Smaller
motion is not visible."""

_MAX_JOINTS = 4096
"""Maximum number of joints: the limit of a pose in the network protocol
(:data:`enliven.wire.posecode.MAX_TRANSFORMS`)."""
_MIN_NOTED_PAUSE_S = 0.1
"""Minimum duration, in seconds, of a pause before the first key that is reported in a note. Programs that
count frames from 1 cause a shorter pause."""


@dataclass
class _Animation:
    """One animation. Its samples are a part of the samples of all animations.

    Attributes:
        name: the animation's name in the file, or a name with its number.
        frames: the slice of its K samples in the samples of all animations.
        seconds: (K,) times of the samples, from 0.
        even: (F,) indices of the evenly spaced samples.
        step: seconds between the evenly spaced samples.
        number: its number in the file.
        start: time of its first sample in the file, in seconds.
    """

    name: str
    frames: slice
    seconds: Float
    even: Int
    step: float
    number: int
    start: float


@np.errstate(
    all="ignore"
)  # Ignore overflow warnings, because numbers of a damaged file may overflow before they are checked.
def read_gltf(
    path: Path | str, *, name: str = "", height: float | None = None, floor: bool = False, weld: bool = False
) -> Rig:
    """Reads a model from a glTF or GLB file.

    A model without a rig gets one bone, from the middle of its bottom to the middle of its top.

    Args:
        path: path of the file.
        name: name of the shape. If empty, the file's name is used.
        height: height in metres to which the model is scaled. If None, it is not scaled.
        floor: True to put its lowest vertex on the floor.
        weld: True to merge vertices with the same position and skin weights, see ``weld_shape``.

    Raises:
        InputError: if the file cannot be read, or has no visible surface.
    """
    rig = _read_unscaled(path, name)
    rig = scale_to_height(rig, height) if height is not None else rig
    rig = place_on_floor(rig) if floor else rig
    return Rig(weld_shape(rig.shape), rig.clips, rig.notes) if weld else rig


def _read_unscaled(path: Path | str, name: str) -> Rig:
    """Reads the model in its original size and position."""
    surface = gltf_surface(path, name)
    file = surface.file
    try:
        if all(part.skin < 0 for part in surface.parts) and not file.document.animations:
            return _make_unrigged_model(surface.mesh, surface.notes)
        return _make_rigged_model(surface)
    except EnlivenError:
        raise
    except DAMAGE as error:
        raise file.create_damage_error(error) from None


def _make_unrigged_model(mesh: Mesh, notes: list[str]) -> Rig:
    low, high = mesh.bounds
    middle = (low + high) / 2
    foot, top = np.array([middle[0], low[1], middle[2]]), np.array([middle[0], high[1], middle[2]])
    skeleton = Skeleton(("foot", "top"), np.array([-1, 0], np.int32), np.stack([foot, top]))
    indices = np.tile(np.array([1, 0, 0, 0], np.uint16), (len(mesh.vertices), 1))
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(mesh.vertices), 1))
    shape = still_shape(mesh.name, skeleton, mesh, SkinWeights(indices, weights))
    return Rig(shape, (), (*notes, NO_RIG_NOTE))


def _make_rigged_model(surface: GltfSurface) -> Rig:
    file, parts, mesh, notes = surface.file, surface.parts, surface.mesh, list(surface.notes)
    animations, world = _sample_animations(file, notes)
    chosen = _joint_candidates(file, parts)
    if len(chosen) > _MAX_JOINTS:
        raise file.create_error(
            f"the model has {len(chosen)} joints, but at most {_MAX_JOINTS} are supported"
        )
    size = float(np.ptp(mesh.vertices, axis=0).max())
    bodies = measure_bodies(surface, chosen, world)
    is_own_file = (file.document.asset.generator or "").startswith("enliven ")
    tree = build_tree(bodies, size, is_own_file)
    body_of = {node: number for number, node in enumerate(chosen)}
    skin = _skin_weights(parts, tree, body_of)
    shape = still_shape(mesh.name, tree.skeleton, mesh, skin)
    clips, used_names = [], set[str]()
    tracks = clip_tracks(bodies, tree, size)
    for animation in animations:
        clip = _animation_clip(animation, tree, bodies, tracks, used_names)
        clips.append(add_cubic_keys(clip, animation.number, animation.start, surface, tree, chosen))
    notes += tree.notes + _make_lost_motion_notes(bodies, tree, size)
    return Rig(shape, tuple(clips), tuple(dict.fromkeys(notes)))


def _sample_animations(file: GltfFile, notes: list[str]) -> tuple[list[_Animation], Float]:
    """Samples all animations. Returns the animations, and the transforms (F, n, 4, 4) from node to world in
    all samples."""
    animations, worlds, start = list[_Animation](), list[Float](), 0
    for number, animation in enumerate(file.document.animations or []):
        even = frame_times(file, number)
        times = np.union1d(even, key_times(file, number, even))
        if (start + len(times)) * len(file.parents) > MAX_NODE_SAMPLES:
            raise file.create_error(
                f"the animations have at least {start + len(times)} frames in total, which is too many"
            )
        step = float(even[1] - even[0]) if len(even) > 1 else 1 / 30
        worlds.append(world_matrices(file, sample_animated_locals(file, number, times)))
        name = animation.name or f"animation {number + 1}"
        if even[0] > _MIN_NOTED_PAUSE_S:
            notes.append(
                f"animation {name!r} begins at {even[0]:.3g} s: the pause before this time is left out"
            )
        own_samples, even_indices = slice(start, start + len(times)), np.searchsorted(times, even)
        animations.append(
            _Animation(name, own_samples, times - times[0], even_indices, step, number, float(times[0]))
        )
        start += len(times)
    count = len(file.document.nodes)
    return animations, np.concatenate(worlds) if worlds else np.zeros((0, count, 4, 4))


def _joint_candidates(file: GltfFile, parts: list[GltfPart]) -> list[int]:
    """Returns the nodes that may be joints, parents before children.

    These are the joints of the used skins, the nodes with a rigidly attached mesh, and animated nodes between
    them.
    """
    joint_nodes = {int(n) for p in parts if p.skin >= 0 for n in file.document.skins[p.skin].joints}
    joint_nodes |= {part.carrier for part in parts if part.skin < 0}
    animated = {c.target.node for a in file.document.animations or [] for c in a.channels}
    between = set[int]()
    for node in joint_nodes:
        ancestor, nodes_between = file.parents[node], list[int]()
        while ancestor >= 0:
            nodes_between.append(ancestor)
            if ancestor in joint_nodes:
                between |= set(nodes_between)
                break
            ancestor = file.parents[ancestor]
    return [n for n in find_moving_nodes(file, parts) if n in joint_nodes or (n in between and n in animated)]


def _skin_weights(parts: list[GltfPart], tree: Tree, body_of: dict[int, int]) -> SkinWeights:
    """Returns skin weights with four bones for each vertex, from the joints that it follows in the file."""
    nodes: Int = np.concatenate([part.nodes for part in parts])
    weights = np.concatenate([part.weights for part in parts])
    bone = np.zeros(max(body_of) + 1, np.uint16)
    for node, body in body_of.items():
        bone[node] = tree.bone.get(body, 0)
    return SkinWeights(bone[nodes], weights.astype(np.float32))


def _animation_clip(
    animation: _Animation,
    tree: Tree,
    bodies: list[LinkBody],
    tracks: tuple[Float | None, Float | None],
    taken: set[str],
) -> Clip:
    """Returns the clip of one animation.

    ``tracks`` are the offsets and strains of all animations. The clip keeps those that are not all zero.
    """
    name = unused(animation.name, taken)
    taken.add(name)
    turns = remove_sign_jumps(np.stack([bodies[k].turns[animation.frames] for k in tree.driver], 1))
    own_tracks = [None if track is None else track[animation.frames] for track in tracks]
    offsets, strains = (None if track is None or not track.any() else track for track in own_tracks)
    root, even = bodies[tree.root].places[animation.frames], animation.even
    mirrors = _compute_mirrored_signs(animation, tree, bodies)
    fine = None
    if len(even) < len(turns):
        fine = FineFrames(animation.seconds, turns, root, offsets, strains, mirrors)
    clip = Clip(name, tree.skeleton, turns, root, animation.step, offsets=offsets, strains=strains)
    clip = replace(clip, mirrors=mirrors)
    return clip if fine is None else replace(clip.map_values(lambda track: track[even]), fine=fine)


def _compute_mirrored_signs(animation: _Animation, tree: Tree, bodies: list[LinkBody]) -> Float | None:
    """Returns an array (K, N) that is -1 for mirrored bones and 1 for all others, or None if no bone is
    mirrored."""
    signs = np.ones((len(animation.seconds), len(tree.driver)))
    for j, driver in enumerate(tree.driver):
        mirrors = bodies[driver].mirrors
        if mirrors is not None:
            signs[:, j] = mirrors[animation.frames]
    return signs if (signs < 0).any() else None


def _make_lost_motion_notes(bodies: list[LinkBody], tree: Tree, size: float) -> list[str]:
    """Returns notes about motion in the animations that the bones cannot reproduce, with its size."""
    drifts = [
        (name, distance)
        for name, distance in joint_drift(bodies, tree)
        if distance > _MIN_NOTED_MOTION_FRACTION * size
    ]
    if not drifts:
        return []
    name, distance = max(drifts, key=lambda pair: pair[1])
    summary = (
        f"animations move {len(drifts)} joint{'s' * (len(drifts) > 1)} away from the bones, which is "
        "not reproduced"
    )
    return [f"{summary}: at most {distance:.3g} m ({distance / size:.1%} of the model's size), at {name}"]
