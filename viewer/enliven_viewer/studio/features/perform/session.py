"""Performing in the studio: an edge's stage next to the project, and recordings from it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from enliven.errors import EnlivenError, InputError
from enliven.wire import CALLS, CameraMessage, Topic, parse_endpoint
from enliven_viewer.language import tr
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.link.edge_search import EdgeSearch
from enliven_viewer.link.stage_link import StageLink
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.live.followed_edge import get_camera, merge_scenes
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.live.shared_space import SharedSpace
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.timeline import Timeline
from enliven_viewer.render.scene import Scene
from enliven_viewer.settings import PlaybackSettings
from enliven_viewer.studio.app.workspace_tabs import WorkspaceTabs, has_tools
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.cameras import CameraSearch
from enliven_viewer.studio.features.perform.character_sizes import CharacterSizes
from enliven_viewer.studio.features.perform.close_up import CloseUp
from enliven_viewer.studio.features.perform.live_overlay import LiveOverlay, OverlayConditions
from enliven_viewer.studio.features.perform.local_edge import Addresses, LocalEdge
from enliven_viewer.studio.features.perform.possession_requests import PossessionRequests
from enliven_viewer.studio.features.perform.recorder import Holder, LiveRecorder
from enliven_viewer.studio.features.perform.recording import StageRecording
from enliven_viewer.studio.features.perform.secondary_edges import SecondaryEdge
from enliven_viewer.studio.features.perform.stage_switches import StagePhysics, StageVoice
from enliven_viewer.studio.features.perform.staged_characters import StagedCharacters


class PerformSession:
    """The window's connection to one edge or to a take, and the recordings from it.

    Args:
        editor: the editor; recordings become edits of its project.
        folder: folder of the stored addresses.
        tabs: the choice of the workspace.

    Attributes:
        live: the followed stage or take; None without a link.
        live_hidden: whether the live stage is hidden outside the Perform workspace.
        scene: the live scene, shown next to the project's characters; None without a link.
        stage_selection: the character selected in the stage's list, if it is not in the project.
        recording: records from the stage onto the timeline.
        secondary_edges: secondary edges, which are shown and recorded too.
        staged: the project's characters on the stage.
        sizes: sizes of the characters on the stage.
        possession_requests: handles requests to possess a character, now or as soon as possible.
        voice: spoken commands.
        physics: loose objects on the stage.
        close_up: moves the view to the limb that the next possession attaches.
        address: text in the address field.
        cameras: the cameras of this machine.
        edge_search: the edges on the network.
        shared_space: places several edges in one space.
    """

    def __init__(self, editor: Editor, folder: Path | None = None, tabs: WorkspaceTabs | None = None) -> None:
        self.editor, self.tabs = editor, tabs or WorkspaceTabs()
        self.addresses = Addresses(folder)
        self.live_hidden = False
        self.live: LiveStage | None = None
        self.scene: Scene | None = None
        self.stage_selection = ""
        self._live_overlay = LiveOverlay(editor)
        self.secondary_edges: list[SecondaryEdge] = []
        self.recording = StageRecording(
            *(
                editor,
                lambda: self.live,
                lambda: self.connected,
                self.check_availability,
                self.describe_missing_edge,
            ),
            self.secondary_edges,
        )
        self.close_up = CloseUp(editor)
        self.staged, self.sizes = StagedCharacters(self), CharacterSizes(editor)
        self.voice, self.physics = StageVoice(editor), StagePhysics(editor)
        self.possession_requests = PossessionRequests(self)
        self.address, self.cameras, self.edge_search = "", CameraSearch(), EdgeSearch()
        self.shared_space = SharedSpace(editor.toasts.show_message)
        self._client: EdgeClient | None = None
        self._feed: EdgeFeed | None = None
        self._local_edge: LocalEdge | None = None
        self._framed_objects: tuple[str, ...] = ()

    @property
    def active_workspace(self) -> str:
        """The current workspace."""
        return self.tabs.active

    @active_workspace.setter
    def active_workspace(self, name: str) -> None:
        self.tabs.active = name

    @property
    def shortcut_workspace(self) -> str:
        """Returns the name of the workspace that determines the active shortcuts. Returns an empty string in
        *Play* without a stage, because there the general shortcuts play the project.
        """
        return "" if self.active_workspace == "Play" and self.live is None else self.active_workspace

    @property
    def hides_live(self) -> bool:
        """Returns True if the live stage is hidden, which applies only outside the Perform workspace."""
        return self.live_hidden and has_tools(self.active_workspace)

    # The link ---------------------------------------------------------------------------------------------

    def connect(self, address: str, settings: PlaybackSettings | None = None) -> None:
        """Follows the edge at an address, HOST or HOST:PORT.

        Raises:
            InputError: if the address is invalid.
        """
        self._follow_edge(address.strip(), settings)
        self.addresses.remember(address.strip())

    def _follow_edge(self, address: str, settings: PlaybackSettings | None = None) -> None:
        """Disconnects the current edge, and follows the edge at an address."""
        client = EdgeClient([address], "enliven window")
        self.disconnect()
        self._client, self._feed = client, (feed := EdgeFeed(client))
        feed.on_message, feed.restarted = self._handle_message, self._handle_restart
        self.live = LiveStage(feed, Document(Timeline(settings or PlaybackSettings())))

    def add_secondary(self, address: str, settings: PlaybackSettings | None = None) -> None:
        """Adds a secondary edge. Its performers are shown and recorded next to the others.

        Raises:
            InputError: if the address is invalid, or already followed.
        """
        wanted_address = address.strip()
        if self._client is None:
            self.connect(wanted_address, settings)
            return
        endpoints = [
            self._client.edges[0].endpoint,
            *(parse_endpoint(guest.address) for guest in self.secondary_edges),
        ]
        if parse_endpoint(wanted_address) in endpoints:
            remedy = tr("Type the address of another computer with a camera.")
            raise InputError(
                tr("this window already follows that stage"), where=wanted_address, remedy=remedy
            )
        # Use the smallest free number, so that no two edges have the same number.
        taken_numbers = {guest.number for guest in self.secondary_edges}
        number = next(n for n in range(1, len(taken_numbers) + 2) if n not in taken_numbers)
        self._client.edges[0].align_clock()
        prefix = partial(self.shared_space.prefix_of, number)
        self.secondary_edges.append(SecondaryEdge(wanted_address, number, settings, prefix))
        self.addresses.remember(wanted_address)

    def make_primary(self, guest: SecondaryEdge, settings: PlaybackSettings | None = None) -> None:
        """Makes a secondary edge the primary one, which receives orders and characters."""
        if self._client is None:
            return
        old_primary, others = (
            str(self._client.edges[0].endpoint),
            [o.address for o in self.secondary_edges if o is not guest],
        )
        self.connect(guest.address, settings)
        for address in (old_primary, *others):
            self.add_secondary(address, settings)

    def remove_secondary(self, guest: SecondaryEdge) -> None:
        """Disconnects a secondary edge. Keeps its part of a running recording."""
        guest.close()
        self.secondary_edges.remove(guest)

    def connect_local(self, *words: str) -> None:
        """Starts an edge on this machine and follows it. ``words`` are its command line arguments.

        Raises:
            ResourceError: if the edge's program is not installed.
        """
        edge = LocalEdge(*words)
        self._follow_edge(str(edge.endpoint))
        self._local_edge = edge
        if self.live is not None:
            self.live.is_local = True

    def follow_take(self, path: Path, settings: PlaybackSettings | None = None) -> None:
        """Plays a recorded take: poses, performers, and attachments.

        Raises:
            InputError: if the file is not a take.
        """
        feed = TakeFeed(path)
        self.disconnect()
        self.live = LiveStage(
            feed, Document(Timeline(settings or PlaybackSettings(), bounded=False)), take=path.name
        )

    def disconnect(self) -> None:
        """Disconnects the edge. Keeps the recording made so far. Ends a local edge together with its stage.
        The project's characters on the stage are put onto the next stage.
        """
        self.recording.stop()
        if self._local_edge is not None:
            self.staged.keep_for_next_stage()
        self.cameras.close()
        self.edge_search.close()
        for guest in self.secondary_edges:
            guest.close()
        self.secondary_edges.clear()
        if self.live is not None:
            self.live.close()
        if self._local_edge is not None:
            self._local_edge.close()
        self.live = self.scene = self._client = self._feed = self._local_edge = None
        self.shared_space.forget()
        self.close_up.advance(0.0, None, None)
        self.stage_selection = ""
        self.editor.live_box = None
        self.staged.sender.forget()
        self.sizes.forget()
        self.possession_requests.forget()
        self.voice.forget()
        self.physics.forget()
        self.recording.recorder = LiveRecorder()

    @property
    def known_addresses(self) -> tuple[str, ...]:
        """Returns the previously used addresses, newest first."""
        return self.addresses.addresses

    @property
    def connected(self) -> bool:
        """Returns True if messages arrive from an edge."""
        return self._client is not None and self.live is not None and self.live.document.edge.connected

    @property
    def client(self) -> EdgeClient | None:
        """Returns the client of the edge, or None without an edge, and while a take is played."""
        return self._client

    @property
    def camera(self) -> CameraMessage | None:
        """Returns the pose and the image of the edge's camera, or None if the edge does not send them."""
        return None if self._client is None else get_camera(self._client)

    @property
    def stage(self) -> StageLink | None:
        """Returns the stage of the edge, or None without an edge."""
        return None if self._client is None else self._client.stage

    @property
    def holders(self) -> tuple[Holder, ...]:
        """Returns the performers who control a character, with the character and the body parts."""
        primary_holders = (
            _number_holders(self.live, self.recording.recorder) if self.connected and self.live else ()
        )
        guest_holders = (
            holder
            for guest in self.secondary_edges
            if guest.connected
            for holder in _number_holders(guest.live, guest.recorder)
        )
        return (*primary_holders, *guest_holders)

    @property
    def performers(self) -> tuple[int, ...]:
        """Returns the ids of the performers in view."""
        return () if self.live is None else tuple(sorted(body.id for body in self.live.scene.bodies))

    @property
    def present(self) -> tuple[str, ...]:
        """Returns the objects on the live stage, one line each: performers, characters, loose objects.

        Returns an empty tuple without a stage.
        """
        if self.live is None:
            return ()
        people = (tr("Performer {0}", self.live.numbers.number_of(body)) for body in self.performers)
        other_lines = (line for guest in self.secondary_edges for line in guest.present)
        return (*people, *self.stage_ids, *other_lines) or (tr("The stage is empty"),)

    @property
    def stage_ids(self) -> tuple[str, ...]:
        """Returns the ids of the characters on the edge's stage."""
        return () if self._client is None else tuple(self._client.characters)

    @property
    def hidden(self) -> frozenset[str]:
        """Returns the hidden characters of the project: their live versions are shown instead."""
        return self._live_overlay.hidden if self.scene is not None else frozenset()

    @property
    def target(self) -> str | None:
        """Returns the selected character, to which orders apply, or None if it is not on the stage."""
        chosen = self.editor.selection.character or self.stage_selection
        return chosen if chosen in self.stage_ids else None

    # Once per frame ---------------------------------------------------------------------------------------

    def advance(self, seconds: float) -> None:
        """Processes received messages, and advances running operations."""
        if self.live is None:
            return
        self.live.target, self.live.held = self.target, {holder.character for holder in self.holders}
        self.live.holding = {holder.body for holder in self.recording.recorder.holders.current_holders}
        self._advance_stages(self.live, seconds)
        self.live.report_view(self.editor.lens.view)
        self._watch_edge()
        if self._client is not None:
            if self.editor.draft is None:
                self.staged.advance()
            self.recording.advance(seconds)
            self.sizes.advance(self._client, self.stage_ids)
            self.voice.advance(self._client, is_near=self.live is not None and self.live.is_local)
            self.physics.advance(self._client)
            self.possession_requests.advance()
        if self.live is None:
            return
        performs = self.active_workspace in ("Perform", "Play")
        heard = self.recording.phase != "idle" or not self.editor.playing
        telling = OverlayConditions(
            performs and self.connected, heard, self.recording.replaces, self.live.held
        )
        self.scene = merge_scenes(self._live_overlay.merge(self.live.scene, telling), self.secondary_edges)
        self.editor.live_box = self.scene.box
        self.close_up.advance(seconds, self.scene if performs else None, self.target)
        if performs and self.live.present != self._framed_objects and self.live.scene.box:
            self.editor.frame_all(at_once=not self._framed_objects, reset=not self._framed_objects)
            self._framed_objects = self.live.present

    def _advance_stages(self, live: LiveStage, seconds: float) -> None:
        """Processes the messages of all edges, and makes the scenes of all edges for the same moment."""
        if self._client is not None and self._client.status is not None and self.secondary_edges:
            self.shared_space.update_transforms(self._client.edges[0].name, self.secondary_edges)
        live.receive(seconds)
        for guest in self.secondary_edges:
            guest.receive(seconds)
        if self._feed is not None:
            stages = [(live, self._feed), *((guest.live, guest.feed) for guest in self.secondary_edges)]
            self.shared_space.align_times(stages)
        for stage in (live, *(guest.live for guest in self.secondary_edges)):
            stage.compose(seconds)

    def _watch_edge(self) -> None:
        """Detects a local edge that failed to start or has ended."""
        if (
            self._local_edge is not None
            and not self.connected
            and (why := self._local_edge.ended) is not None
        ):
            problem, _, remedy = why.removeprefix("enliven: ").partition(". ")
            self.editor.toasts.show_error(
                EnlivenError(problem, where="the stage on this machine", remedy=remedy)
            )
            self.disconnect()

    def _handle_restart(self) -> None:
        """Handles a restart of the edge.

        Follows its new clock, and puts the characters on its empty stage again.
        """
        self.recording.recorder.handle_restart()
        self.staged.send_all_again()

    def _handle_message(self, topic: Topic, value: Any) -> None:
        """Handles commands from a pedal or the microphone, and passes all other messages to the recorder."""
        if topic is not CALLS:
            self.recording.recorder.record(topic, value)
        elif value.word == "again":
            self.recording.record_again()
        elif value.word == "record" or self.recording.phase != "idle":
            self.recording.toggle()

    # What is missing --------------------------------------------------------------------------------------

    def describe_missing_edge(self) -> str:
        """Returns the reason why no edge can be used, with advice, or an empty text if an edge
        can be used.
        """
        if self.connected:
            return ""
        if self.live is not None and self.live.is_local and not len(self.live.document.timeline):
            return tr("{0}. Wait until the camera sees a person", self.live.preparation_text)
        return "The stage sends nothing. Check that its camera program (enliven edge) is running"

    def describe_missing_voice(self) -> str:
        """Returns the reason why the microphone cannot be switched, with advice, or an empty
        text if it can.
        """
        return self.describe_missing_edge() or (self.voice.status if self.voice.state is None else "")

    def describe_missing_physics(self) -> str:
        """Returns the reason why the physics cannot be switched, with advice, or an empty text
        if they can.
        """
        return self.describe_missing_edge() or (self.physics.state_text if self.physics.state is None else "")

    def describe_missing_recording(self) -> str:
        """Returns the reason why no alternative of the last recording can be recorded, with advice. The text
        is empty if this is possible.
        """
        last = self.recording.last_recording or self.recording.phase == "recording"
        return self.describe_missing_edge() or ("" if last else "Nothing was recorded yet. Record first")

    def check_availability(self, lacking: str) -> bool:
        """Returns True if ``lacking`` is empty. Otherwise shows it as a message."""
        if lacking:
            self.editor.toasts.show_message(*tr(lacking).split(". "))
        return not lacking


def _number_holders(live: LiveStage, recorder: LiveRecorder) -> tuple[Holder, ...]:
    """Returns the performers who control a character on one edge, with their displayed numbers."""
    return tuple(
        replace(holder, number=live.numbers.number_of(holder.body))
        for holder in recorder.holders.current_holders
    )
