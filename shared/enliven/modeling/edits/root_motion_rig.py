"""Root layers for every rig: they rotate and move the result of the rig as a whole.

The rigs themselves do not know about root layers. This wrapper applies them on top, once for all rigs. Cuts
and merges process a character with root layers that were baked into its placement at that time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.document import Character, GraphCharacter, MotionKey, PoseStream, Project
from enliven.modeling.edits.root_layers import RigidMotion, root_motion, root_motions
from enliven.modeling.mesh.cut_surfaces import CutSurface
from enliven.modeling.rig import CharacterState, HandleMotion, Merge, Player, RigEdits
from enliven.modeling.rigged.axes import Axes
from enliven.rotation import multiply, normalized, rotate, to_matrix


class RootMotionRig(RigEdits):
    """A wrapper around the edits of a rig, for characters with root layers.

    Args:
        wrapped: the edits of the wrapped rig.
    """

    def __init__(self, wrapped: RigEdits) -> None:
        self.wrapped, self.frames = wrapped, wrapped.frames

    def centre(self, character: Any) -> Float:
        """Returns the centre (3,) of the character, in metres, without root layers."""
        return self.wrapped.centre(character)

    def rest(self, character: Any) -> Float:
        """Returns the vertices at rest (V, 3) in metres, which root layers do not change."""
        return self.wrapped.rest(character)

    def make_drawing(self, character: Any) -> Character:
        """Returns the mesh and pivots, which root layers do not change."""
        return self.wrapped.make_drawing(character)

    def compute_vertices(self, project: Project, character: Any, time: float) -> Float:
        """Returns the vertices (V, 3) in metres, moved by the root layers."""
        return root_motion(project, character, time)(self.wrapped.compute_vertices(project, character, time))

    def create_player(self, project: Project, character: Any) -> Player:
        """Returns a function from a time to the pose and the handles, both moved by the root layers."""
        rig_player = self.wrapped.create_player(project, character)

        def at(time: float) -> CharacterState:
            (pose, handles), motion = rig_player(time), root_motion(project, character, time)
            linear, positions = _apply_motion(motion, pose.linear, pose.positions)
            moved = replace(pose, linear=linear.astype(np.float32), positions=positions.astype(np.float32))
            return CharacterState(moved, motion(handles))

        return at

    def handle_motion(
        self, character: Any, player: Player, handle: int | None, layer: int | None
    ) -> HandleMotion | None:
        """Returns the motion of a handle under the given player."""
        return self.wrapped.handle_motion(character, player, handle, layer)

    def create_surface_player(self, project: Project, character: Any) -> Callable[[float], Float]:
        """Returns a function from a time in seconds to the vertices (V, 3) in metres, moved by the root
        layers.
        """
        rig_surface = self.wrapped.create_surface_player(project, character)
        return lambda time: root_motion(project, character, time)(rig_surface(time))

    def find_missing_data(self, project: Project, character: Any) -> tuple[str, ...]:
        """Returns the wrapped rig's sentences about missing data. Root layers do not change them."""
        return self.wrapped.find_missing_data(project, character)

    def check_layers(self, project: Project, character: Any, numbers: set[int]) -> None:
        """Raises an error if one of the layers in ``numbers`` belongs to the wrapped rig and cannot be
        played."""
        count = len(character.playing) - len(character.root_layers)
        self.wrapped.check_layers(project, character, {number for number in numbers if number < count})

    def drag_handle(
        self, project: Project, character: Any, handle: int, place: Float, time: float
    ) -> Project:
        """Drags the handle to the position that corresponds to ``place`` without root layers."""
        back = root_motion(project, character, time).inverse
        return self.wrapped.drag_handle(project, character, handle, back(place[None])[0], time)

    def key_layer(self, project: Project, character: Any, handle: int) -> int | None:
        """Returns the layer number of the wrapped rig. Root layers are numbered after all other layers."""
        return self.wrapped.key_layer(project, character, handle)

    def find_keyable(self, character: Any, handle: int | str) -> int:
        """Returns the number of a bone or node of the wrapped rig."""
        return self.wrapped.find_keyable(character, handle)

    def with_key_layer(self, project: Project, character: Any, handle: int, key: MotionKey) -> Project:
        """Adds the layer to the wrapped rig. The root layers stay unchanged."""
        return self.wrapped.with_key_layer(project, character, handle, key)

    def move(self, character: Any, offset: Float, turn: Float, about: Float) -> Any:
        """Moves the character, together with the centre and the axes of each root layer."""
        moved = self.wrapped.move(character, offset, turn, about)
        layers = tuple(
            replace(
                layer,
                about=rotate(turn, layer.about - about) + about + offset,
                basis=normalized(multiply(turn, layer.basis)),
            )
            for layer in character.root_layers
        )
        return moved.with_changes(root_layers=layers)

    def scale(self, character: Any, factor: float) -> Any:
        """Scales the character and the path of its root layers."""
        centre = self.centre(character)
        layers = tuple(
            replace(layer, about=centre + factor * (layer.about - centre), size=factor * layer.size)
            for layer in character.root_layers
        )
        return self.wrapped.scale(character, factor).with_changes(root_layers=layers)

    def mirror(self, project: Project, character: Any, axes: Axes) -> Any:
        """Mirrors the character and the path of its root layers."""
        centre = self.centre(character)
        layers = tuple(
            axes.layer(replace(layer, about=centre + axes.vectors(layer.about - centre)))
            for layer in character.root_layers
        )
        return self.wrapped.mirror(project, character, axes).with_changes(root_layers=layers)

    def convert_to_graph_shape(
        self, project: Project, character: Any, times: Float, stream_id: str
    ) -> tuple[GraphCharacter, PoseStream, str]:
        """Converts to a graph with the root layers baked into the motion of the nodes."""
        graph, stream, note = self.wrapped.convert_to_graph_shape(project, character, times, stream_id)
        seconds = times[0] + stream.step * np.arange(len(stream.positions))
        motions = root_motions(project, character, seconds)
        linear, positions = _apply_motion(motions, stream.linear, stream.positions)
        stream = replace(stream, linear=linear, positions=positions)
        return graph.with_changes(root_layers=()), stream, note

    def cut(
        self, project: Project, name: str, stroke: CutSurface, time: float, *, notes: list[str]
    ) -> tuple[Project, tuple[str, ...]]:
        """Cuts the character in its pose at ``time``. Its root layers then move all parts."""
        character = project.character(name)
        project, parts = self.wrapped.cut(
            remove_root_layers(self.wrapped, project, name, time), name, stroke, time, notes=notes
        )
        for part in parts:
            project = restore_root_layers(self.wrapped, project, part, character, time)
        return project, parts

    def merge(self, project: Project, merge: Merge) -> Project:
        """Merges two characters. Their root layers must be baked before."""
        return self.wrapped.merge(project, merge)


def remove_root_layers(rig_edits: RigEdits, project: Project, name: str, time: float) -> Project:
    """Removes a character's root layers, and moves the character to its position with them at a time."""
    character = project.character(name)
    if not character.root_layers:
        return project
    turn, move = root_motion(project, character, time)
    bare = character.with_changes(root_layers=())
    return project.with_characters(rig_edits.move(bare, move, turn, np.zeros(3)))


def restore_root_layers(
    rig_edits: RigEdits, project: Project, name: str, previous: Any, time: float
) -> Project:
    """Restores the root layers of ``previous`` that :func:`remove_root_layers` removed, and reverts its
    move."""
    character = project.character(name)
    if not previous.root_layers:
        return project
    turn, move = root_motion(project, previous, time).inverse
    moved = rig_edits.move(character, move, turn, np.zeros(3))
    return project.with_characters(moved.with_changes(root_layers=previous.root_layers))


def _apply_motion(motion: RigidMotion, linear: AnyArray, positions: AnyArray) -> tuple[Float, Float]:
    """Returns linear maps (..., N, 3, 3) and positions (..., N, 3) with the rigid motion applied after
    them."""
    return to_matrix(motion.turn)[..., None, :, :] @ linear, motion(positions)
