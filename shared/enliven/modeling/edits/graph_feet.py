"""Foot lock for a possessed mesh: a layer on top of its motion keeps the feet in place.

    project = stand(project, "chair", [0], "always")       # the feet that part 0 moves
    graph_foot_lock_mode(shape, 0) -> "always"

The feet are the lowest parts of the mesh at rest, or parts that an artist named. Contacts are detected once,
from the paths of the feet, as for skeletons (:mod:`enliven.motion.contact`). Let s_n^j be the fraction of
foot j's displacement that node n follows (:func:`~enliven.modeling.possessed.following.find_followers`). The
corrections c solve S c = d, where S_ij is the mean of s^j over foot i, weighted by its skin weights. So each
foot moves exactly by its required correction d_i, and the mesh bends above it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from enliven.arrays import Float, Int
from enliven.document import (
    FEET,
    KEY_STEP,
    ContactSettings,
    GraphCharacter,
    GraphLayer,
    PoseStream,
    Project,
    SkinWeights,
    unused,
)
from enliven.errors import InputError
from enliven.modeling.edits.root_layers import root_motion
from enliven.modeling.mesh.meshes import blend_vertices
from enliven.modeling.possessed.following import find_followers
from enliven.modeling.possessed.pose import graph_pose
from enliven.motion.contact.contacts import compute_hold_weights, find_contacts
from enliven.motion.contact.foot_lock import find_analysis_window
from enliven.rotation import conjugate, rotate

_SOLE_HEIGHT_FRACTION = 0.04
"""Maximum height of a foot's vertices above the lowest vertex, as a fraction of the mesh's height. This is
the height of a hoof or a sole."""
_MIN_FOOT_DISTANCE_FRACTION = 0.06
"""Minimum distance of two feet, as a fraction of the mesh's size. Nearer vertices belong to one foot."""
_LIMB_LENGTH_FRACTION = 0.5
"""Assumed length of a limb as a fraction of the mesh's height, as for the legs of a chair or a person."""
_MAX_VERTICES_PER_FOOT = 48
"""Maximum number of sampled vertices per foot. A few are enough, because a foot moves nearly rigidly."""
_MAX_FEET = 12
"""Maximum number of feet. The largest are used. Twelve are more than an insect has."""


@dataclass(frozen=True, eq=False)
class StandingFoot:
    """A part of a mesh that stands on the floor.

    Attributes:
        vertices: (K,) the mesh's vertices that belong to the foot.
        node: the nearest node of the deformation graph.
    """

    vertices: Int
    node: int


def graph_foot_lock_mode(shape: GraphCharacter, number: int) -> str:
    """Returns the foot lock mode of the feet that a layer moves, or "never" if they stay as performed."""
    nodes = _nodes_of_layers(shape, [number])
    modes = [layer.feet for layer in shape.over if layer.feet and np.isin(layer.own, nodes).any()]
    return modes[0] if modes else "never"


def stand(project: Project, shape_id: str, numbers: Iterable[int], feet: str) -> Project:
    """Sets the foot lock mode of a possessed mesh. Contacts are detected in its current motion.

    Args:
        numbers: numbers of the mesh's layers. The mode applies to the feet of the parts that these layers
            move.
        feet: "auto" locks feet while they are low and slow, and "always" locks feet while they are low. Both
            keep feet above the floor. "ground" only lifts feet that are below the floor, and "never" leaves
            feet as performed.

    Raises:
        InputError: if the mesh or mode does not exist, or if these parts have no feet.
    """
    shape = project.graph(shape_id)
    if feet not in FEET:
        raise InputError(
            f"{feet!r} is not a foot lock mode", where=shape.where, remedy=f"Known modes: {', '.join(FEET)}."
        )
    nodes = _nodes_of_layers(shape, numbers)
    old = [top_layer for top_layer in shape.over if top_layer.feet and np.isin(top_layer.own, nodes).any()]
    bare = shape.with_changes(
        over=tuple(top_layer for top_layer in shape.over if not any(top_layer is o for o in old))
    )
    if feet == "never":
        return project.with_characters(bare)
    standing_feet = find_feet(bare, nodes)
    if not standing_feet:
        remedy = "Choose the lane of a part that touches the floor, or name the ends of the limbs (E)."
        raise InputError("none of the chosen parts has a foot on the floor", where=shape.where, remedy=remedy)
    project = project.with_characters(bare)
    name = (
        old[0].take
        if old and _playing_layer_count(project, old[0].take) == 0
        else unused(f"{shape_id} feet", project.streams)
    )
    stream, layer = _foot_lock_layer(project, bare, standing_feet, feet, name)
    locked = bare.with_changes(over=(layer, *bare.over))
    return project.with_streams(stream).with_characters(locked)


def find_feet(shape: GraphCharacter, nodes: Int) -> list[StandingFoot]:
    """Returns the feet that some nodes of a possessed mesh move, the largest first."""
    vertices = np.asarray(shape.mesh.vertices)
    size, tall = float(np.ptp(vertices, axis=0).max()), float(np.ptp(vertices[:, 1]))
    carried = np.isin(shape.skin.indices[np.arange(len(vertices)), shape.skin.weights.argmax(1)], nodes)
    if len(shape.ends):
        near = [
            np.linalg.norm(vertices - end, axis=1) < _MIN_FOOT_DISTANCE_FRACTION * size
            for end in shape.ends[3:]
        ]
        groups = [np.flatnonzero(is_near & carried) for is_near in near]
    else:
        low = np.flatnonzero((vertices[:, 1] < vertices[:, 1].min() + _SOLE_HEIGHT_FRACTION * tall) & carried)
        groups = _find_proximity_groups(vertices[low], low, _MIN_FOOT_DISTANCE_FRACTION * size)
    groups = sorted((group for group in groups if len(group)), key=len, reverse=True)[:_MAX_FEET]
    feet = []
    for group in groups:
        foot_vertices = group[:: max(len(group) // _MAX_VERTICES_PER_FOOT, 1)]
        away = np.linalg.norm(shape.positions[nodes] - vertices[foot_vertices].mean(0), axis=1)
        feet.append(StandingFoot(foot_vertices, int(nodes[away.argmin()])))
    return feet


def _find_proximity_groups(places: Float, numbers: Int, apart: float) -> list[Int]:
    """Groups points (K, 3) by distance, and returns the ``numbers`` (K,) of each group. Points of different
    groups are more than ``apart`` metres apart."""
    if not len(places):
        return []
    pairs = scipy.spatial.cKDTree(places).query_pairs(apart, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(places),) * 2)
    count, label = connected_components(links, directed=False)
    return [numbers[label == part] for part in range(count)]


def _nodes_of_layers(shape: GraphCharacter, numbers: Iterable[int]) -> Int:
    """Returns the numbers (K,) of all nodes of the parts that the given layers of a possessed mesh play or
    move."""
    starts, chosen = shape.starts, set[int]()
    for number in numbers:
        if number < len(shape.parts):
            chosen.add(number)
        elif number < len(shape.parts) + len(shape.over):
            nodes = shape.over[number - len(shape.parts)].own
            chosen |= set((np.searchsorted(starts, nodes, side="right") - 1).tolist())
        else:
            chosen |= set(range(len(shape.parts)))
    rows = [np.arange(starts[part], starts[part + 1]) for part in sorted(chosen)]
    return np.concatenate([np.zeros(0, np.int64), *rows])


def _playing_layer_count(project: Project, take: str) -> int:
    """Returns the number of layers in the project that play a stream."""
    every = (layer for character in project.graphs.values() for layer in character.playing)
    return sum(layer.take == take and layer.source == "streams" for layer in every)


def _foot_lock_layer(
    project: Project, shape: GraphCharacter, feet: Sequence[StandingFoot], contact_mode: str, name: str
) -> tuple[PoseStream, GraphLayer]:
    """Returns the stream and the layer that lock the feet in a shape's current motion."""
    window = find_analysis_window([*shape.parts, *shape.over], project.streams)
    count = max(round((window.end - window.start) / KEY_STEP), 1) + 1
    step = (window.end - window.start) / (count - 1) or KEY_STEP
    times = window.start + step * np.arange(count)
    places, soles, back = np.empty((len(feet), count, 3)), np.empty((len(feet), count)), []
    for frame, time in enumerate(times):
        linear, positions = graph_pose(project, shape, float(time))
        root = root_motion(project, shape, float(time))
        for number, foot in enumerate(feet):
            points = root(_foot_surface(shape, foot, linear, positions))
            places[number, frame], soles[number, frame] = points.mean(0), points[:, 1].min()
        # Compute the map from a displacement in the world to the corresponding displacement of the node at
        # rest.
        back.append((np.linalg.inv(linear), conjugate(root.turn)))
    lacking = np.stack(
        [_foot_corrections(shape, p, s, step, contact_mode) for p, s in zip(places, soles, strict=True)]
    )
    own_nodes, shares = _foot_shares(shape, feet)
    means = np.array(
        [[_mean_displacement(shape, foot, shares[:, j]) for j in range(len(feet))] for foot in feet]
    )
    driven = np.linalg.lstsq(means, lacking.reshape(len(feet), -1), rcond=None)[0].reshape(lacking.shape)
    offsets = np.einsum("nj,jfc->fnc", shares, driven)[:, own_nodes]
    for frame, (inverse, turn) in enumerate(back):
        offsets[frame] = np.einsum("nij,nj->ni", inverse[own_nodes], rotate(turn, offsets[frame]))
    rest = shape.positions[own_nodes]
    stream = PoseStream(name, np.tile(np.eye(3), (count, len(own_nodes), 1, 1)), rest + offsets, step)
    when = {"offset": window.start, "loop": window.looped}
    return stream, GraphLayer(name, np.arange(len(own_nodes)), own_nodes, rest, feet=contact_mode, **when)


def _foot_surface(shape: GraphCharacter, foot: StandingFoot, linear: Float, positions: Float) -> Float:
    """Returns the posed vertices (K, 3) in metres of a foot."""
    vertices = foot.vertices
    skin = SkinWeights(shape.skin.indices[vertices], shape.skin.weights[vertices])
    return blend_vertices(np.asarray(shape.mesh.vertices)[vertices], skin, shape.positions, linear, positions)


def _foot_corrections(
    shape: GraphCharacter, places: Float, soles: Float, step: float, contact_mode: str
) -> Float:
    """Returns the corrections (F, 3) in metres of a foot in F frames. The foot has positions (F, 3) and sole
    heights (F,)."""
    if contact_mode == "ground":
        return np.maximum(-soles, 0.0)[:, None] * [0.0, 1.0, 0.0]
    limb, settings = _LIMB_LENGTH_FRACTION * float(np.ptp(shape.mesh.vertices[:, 1])), ContactSettings()
    modes = np.full(len(places), FEET.index(contact_mode))
    contacts = find_contacts(places, step, limb, settings, modes)
    weights, goals = np.empty(len(places)), np.empty((len(places), 3))
    times = step * np.arange(len(places))
    compute_hold_weights(
        times, contacts.starts, contacts.ends, contacts.places, settings.blend, weights, goals
    )
    goals[:, 1] += settings.rise * np.maximum(places[:, 1] - goals[:, 1], 0.0)
    lacking = np.where(weights[:, None] > 0.0, weights[:, None] * (goals - places), 0.0)
    if contact_mode == "always":
        lacking[:, 1] += np.maximum(-(soles + lacking[:, 1]), 0.0)
    return np.asarray(lacking)


def _foot_shares(shape: GraphCharacter, feet: Sequence[StandingFoot]) -> tuple[Int, Float]:
    """Returns the numbers (K,) of the nodes that follow any of the J feet, and (N, J) the fraction of each
    foot's motion that each of all N nodes follows."""
    shares = np.zeros((len(shape.positions), len(feet)))
    for number, foot in enumerate(feet):
        own_nodes, follow = find_followers(shape, foot.node)
        shares[own_nodes, number] = follow[:, 0]
    return np.flatnonzero(shares.any(1)), shares


def _mean_displacement(shape: GraphCharacter, foot: StandingFoot, node_weights: Float) -> float:
    """Returns the mean of the fractions ``node_weights`` (N,) over a foot's vertices, weighted by the skin.
    If each node moves by its fraction of a displacement, the foot moves by this fraction."""
    indices, weights = shape.skin.indices[foot.vertices], shape.skin.weights[foot.vertices]
    return float((np.asarray(weights, np.float64) * node_weights[indices]).sum(1).mean())
