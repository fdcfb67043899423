"""Live outputs of a window: sends the shown characters and performers to other programs."""

from __future__ import annotations

import time

import numpy as np

from enliven.document import Character, Pose, Skeleton, SkinWeights
from enliven.errors import InputError, ResourceError
from enliven.motion_clips.recorded_characters import skeleton_from_bones
from enliven.outputs.live_frame import CharacterInfo, CharacterInfos, LiveEvent, LiveFrame, PerformerSlots
from enliven.outputs.opening import OutputSet
from enliven.supervision.closeable import Closeable
from enliven_viewer.language import later
from enliven_viewer.render.scene import Scene
from enliven_viewer.studio.viewport.stage_character import StageCharacter
from enliven_viewer.studio.workspace.workspace import Workspace


class WindowOutputs(Closeable):
    """Sends the state of each drawn frame to the outputs. It never waits for a receiver.

    Characters of the project are sent in their poses at the playhead. Characters of an edge or a take are
    sent in their poses at the shown moment. While playback is paused, the same pose is sent with every drawn
    frame. The frames have times of this computer's clock, which also advances during a pause.

    Args:
        workspace: the window's workspace. outputs: the open outputs. This object closes them.
    """

    def __init__(self, workspace: Workspace, outputs: OutputSet) -> None:
        self._workspace, self._outputs = workspace, outputs
        self._infos, self._numbers = CharacterInfos(), PerformerSlots()
        self._stand_ins: dict[str, tuple[Skeleton, Character]] = {}
        self._held = frozenset[str]()
        self._checked: dict[str, CharacterInfo] = {}
        self._failing = frozenset[str]()

    def send(self) -> None:
        """Sends the shown stage to every output. Call once per frame. Does not block."""
        if not self._outputs.statuses:
            return
        frame = self._frame(time.monotonic_ns())
        self._check_outputs(dict(frame.characters))
        self._outputs.put(frame)
        self._show_troubles()

    def close(self) -> None:
        """Sends the last frame, and ends the sender process."""
        self._outputs.close()

    def _frame(self, now_ns: int) -> LiveFrame:
        """Returns the shown stage as a live frame."""
        project = self._workspace.shown_characters
        scene = self._workspace.shown_scene or Scene()
        drawn = {standing.id: self._find_character_info(standing) for standing in project}
        shapes = {name: character for name, character in drawn.items() if character is not None}
        poses: dict[str, Pose] = {standing.id: standing.pose for standing in project if standing.id in shapes}
        found_skeletons = {standing.id: standing.character.find_skeleton() for standing in project}
        skeletons = {name: skeleton for name, skeleton in found_skeletons.items() if skeleton is not None}
        for actor in scene.actors:
            if actor.character.id not in shapes:
                shapes[actor.character.id], poses[actor.character.id] = actor.character, actor.pose
        infos = self._infos.update(
            shapes, lambda name: skeletons[name] if name in skeletons else _live_skeleton(shapes[name])
        )
        numbered, events = self._numbers.number(scene.bodies, now_ns)
        held = self._workspace.live.find_held() & shapes.keys()
        events += [LiveEvent("possess", 0, name) for name in sorted(held - self._held)]
        events += [LiveEvent("release", 0, name) for name in sorted(self._held - held)]
        self._held = held
        return LiveFrame(now_ns, numbered, tuple(poses.values()), infos, held, scene.props, events)

    def _find_character_info(self, standing: StageCharacter) -> Character | None:
        """Returns the constant data of a character of the project. A skeleton without a surface
        is allowed.
        """
        name, skeleton = standing.id, standing.character.find_skeleton()
        if standing.drawn is not None or skeleton is None:
            return standing.drawn
        stand_in = self._stand_ins.get(name)
        if stand_in is None or stand_in[0] is not skeleton:
            stand_in = self._stand_ins[name] = (skeleton, _character_without_surface(name, skeleton))
        return stand_in[1]

    def _check_outputs(self, infos: dict[str, CharacterInfo]) -> None:
        """Shows an error if an output cannot send the character that its address names."""
        if infos == self._checked:
            return
        self._checked = infos
        try:
            self._outputs.check(infos)
        except InputError as error:
            self._workspace.editor.toasts.show_error(error)

    def _show_troubles(self) -> None:
        """Shows an error for each output that has begun to lose packets."""
        troubles = self._outputs.troubles
        for name in sorted(troubles.keys() - self._failing):
            remedy = later("Start the receiving program, and compare its address and port with the output's.")
            problem = later("the output loses packets: {0}", troubles[name])
            self._workspace.editor.toasts.show_error(ResourceError(problem, where=name, remedy=remedy))
        self._failing = frozenset(troubles)


def _live_skeleton(character: Character) -> Skeleton | None:
    """Returns the skeleton of a received character, or None if it has no named bones."""
    if character.kind != "bones" or character.names is None:
        return None
    try:
        return skeleton_from_bones(character)
    except InputError:  # The bones are not connected, so the character is sent without a skeleton.
        return None


def _character_without_surface(name: str, skeleton: Skeleton) -> Character:
    """Returns a character with the bones of a skeleton, and one small triangle in place of a surface."""
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.array([1, 0, 0, 0], np.float32), (3, 1)))
    corners = (skeleton.positions[0] + 0.01 * np.eye(3)).astype(np.float32)
    pivots = skeleton.positions[np.maximum(skeleton.parents, 0)].astype(np.float32)
    triangle, edges = np.array([[0, 1, 2]], np.int32), np.zeros((0, 2), np.int32)
    return Character(name, corners, triangle, skin, pivots, edges, "bones", names=skeleton.names)
