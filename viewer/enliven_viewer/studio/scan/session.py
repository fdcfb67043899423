"""A scan in the window: what is asked of the edge, what comes of it, and the character that it becomes."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from enliven.arrays import Float
from enliven.document import Character
from enliven.formats.project import project_of_mesh
from enliven.meshes import Mesh
from enliven.wire import SCAN, SCAN_PIECE, Answer, Refused, Scan, ScanMessage
from enliven_viewer.language import later, tr
from enliven_viewer.render import Scene
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.perform import NO_STAGE, PerformSession
from enliven_viewer.studio.picture import GrowingPicture
from enliven_viewer.studio.scan.box import DraggedBox, box_about
from enliven_viewer.studio.scan.growing import GrowingMesh
from enliven_viewer.studio.viewport import Point

Size = Literal["thing", "small", "room"]
Kept = Literal["thing", "box", "all"]
Way = Literal["round", "laid", "spun", "turned", "person"]
VOXELS: dict[Size, float] = {"small": 0.002, "thing": 0.004, "room": 0.01}
"""Metres of a voxel's side by what is scanned: a cup, a chair, a room."""
_PERSON = 0.008
"""Metres of a voxel's side of a person at two metres: in smaller ones it is often unclear how they turned."""
_WITHIN = 1.5
"""Metres from a camera that stands still within which a thing is turned."""
_ABOVE = 0.012
"""Metres by which it is drawn higher: its floor is seen, and not the stage's."""
_WORDS = 0.5
"""Metres of the picture above it for the words."""
_FRAMED = 8
"""Images from which on it is brought into the picture: the middle of what is looked at is known."""
_STANDS_NS = 1_000_000_000
"""Nanoseconds of the sensor's clock for which a person stands still, after the last side came into view, to
become a character: a slow edge sees as many images of it as a quick one."""
_OFF = ScanMessage()


class ScanSession:
    """The scan of the edge that the window follows.

    Args:
        editor: what is edited; what was scanned becomes a character of its project.
        perform: the link to the edge.

    Attributes:
        shown: whether the panel is open.
        said: how the scan goes, as the edge tells it.
        size: what is to be scanned.
        way: "round": the camera is carried round it; "laid": and it is laid on its back or side meanwhile;
            "spun": it turns on a turntable, and is followed apart from the room;
            "turned": it is turned before a camera that stands still;
            "person": a person turns before it, and becomes a character as soon as all sides were seen.
        keeps: what stands on the floor, what is in the box, or all that was scanned.
        box: the box that the artist drags.
        name: the character that it becomes; empty: the edge finds a name.
    """

    def __init__(self, editor: Editor, perform: PerformSession) -> None:
        self.editor, self.perform = editor, perform
        self.shown = False
        self.way: Way = "round"
        self.keeps: Kept = "thing"
        self.box = DraggedBox()
        self.size: Size = "thing"
        self.name = ""
        self.said = _OFF
        self._growing = GrowingMesh()
        self._wanted: tuple[int, str] | None = None
        self._framed = -1
        self._round_ns: int | None = None

    @property
    def active(self) -> bool:
        """Returns True if a scan is under way on the edge."""
        return self.said.phase in ("scanning", "paused", "finishing", "failed")

    @property
    def surface(self) -> tuple[GrowingPicture, Float] | None:
        """What grows and (4, 4) where it stands on the stage; None if nothing does."""
        if not self.active or self._growing.picture is None:
            return None
        return self._growing.picture, self.stage_from_scan

    def beside(self, live: Scene | None) -> Scene | None:
        """What is live without its characters while a scan is under way: only what is scanned is seen."""
        return replace(live, actors=(), boards={}) if live is not None and self.active else live

    @property
    def stage_from_scan(self) -> Float:
        """Returns (4, 4) where the scan's world stands on the stage."""
        place = np.vstack([np.array(self.said.stage_from_scan).reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
        place[1, 3] += _ABOVE
        return place

    # Orders -----------------------------------------------------------------------------------------------

    def lacks_stage(self) -> str:
        """Returns why nothing can be scanned, and what to do about it; empty if it can."""
        if self.perform.client is None:
            return NO_STAGE
        return self.perform.lacks_edge()

    def lacks_scan(self) -> str:
        """Returns why the scan cannot be told anything; empty if it can."""
        none = "" if self.active else "Nothing is scanned. Start a scan first"
        making = "It is being made. Wait until it stands there" if self.said.phase == "finishing" else ""
        return self.lacks_stage() or none or making

    def lacks_undo(self) -> str:
        """Returns why nothing can be taken back; empty if it can."""
        return self.lacks_scan() or (
            "" if self.said.undoable > 0 else "There is nothing to take back. Scan on"
        )

    def lacks_again(self) -> str:
        """Returns why nothing can be added to a scan; empty if it can."""
        there = self.said.phase == "done"
        return self.lacks_stage() or ("" if there else "No scan is done. Finish one, then add to it")

    def open(self) -> None:
        """Shows the panel, in the workspace where the stage is."""
        self.perform.room, self.shown = "Perform", True

    def start(self) -> None:
        """Begins a scan."""
        self.open()
        if lacking := self.lacks_stage():
            self.editor.toasts.say(*tr(lacking).split(". "))
            return
        within = _WITHIN if self.way == "turned" else None
        name = self.name.strip() or None
        laid, spun, person = (self.way == way for way in ("laid", "spun", "person"))
        voxel = _PERSON if person else VOXELS[self.size]
        self._ask(Scan("start", name, voxel, within, moved=laid, turned=spun, person=person))

    def pause(self) -> None:
        """Pauses it, or goes on."""
        self._ask(Scan("pause" if self.said.phase == "scanning" else "go on"))

    def again(self) -> None:
        """Goes on with a scan that was done: what is seen now is added to it."""
        self.open()
        self._ask(Scan("go on"))

    def undo(self) -> None:
        """Takes the last seconds back."""
        self._ask(Scan("undo"))

    def done(self) -> None:
        """Makes a character of it."""
        if self.keeps != "box":
            self._ask(Scan("done", whole=self.keeps == "all"))
            return
        corners = [float(x) for x in self.box.corners.ravel()]
        self._ask(Scan("done", box=corners, stage_from_scan=list(self.said.stage_from_scan)))

    def cancel(self) -> None:
        """Forgets it."""
        self._ask(Scan("cancel"))

    def keep(self, what: Kept) -> None:
        """Chooses what is kept; a box begins round what stands in the middle."""
        if what == "box" and self.keeps != "box":
            self.fit_box()
        self.keeps = what

    def fit_box(self) -> None:
        """Puts the box round what stands in the middle of the stage."""
        grown, place = self._growing.picture, self.stage_from_scan
        points = np.zeros((0, 3)) if grown is None else np.asarray(grown.vertices, float)
        self.box.corners = box_about(points @ place[:3, :3].T + place[:3, 3])

    @property
    def boxed(self) -> bool:
        """Returns True if the box is drawn and can be dragged."""
        return self.active and self.said.phase != "finishing" and self.keeps == "box"

    # The box's handles over the picture -------------------------------------------------------------------

    def press(self, at: Point) -> bool:
        """Returns the left button went down over the picture; returns whether it takes a side of the box."""
        return self.boxed and self.box.press(at, self.editor.lens)

    def drag(self, at: Point) -> None:
        """The pointer moved while a side is held."""
        self.box.drag(at, self.editor.lens)

    def release(self) -> None:
        """The button went up."""
        self.box.release()

    def _ask(self, order: Scan) -> None:
        client = self.perform.client
        if client is not None:
            client.ask(order, self._answered)

    def _answered(self, answer: Answer) -> None:
        if isinstance(answer, Refused):
            what, _, mend = answer.reason.removeprefix("scan: ").partition(". ")
            self.editor.toasts.say(what[:1].upper() + what[1:], mend)

    # Once a picture ---------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Takes in what the edge tells."""
        client = self.perform.client
        if client is None:
            self.said = _OFF
            return
        client.take(SCAN)
        client.take(SCAN_PIECE)
        before, place = self.said, self.stage_from_scan
        self.said = client.latest(SCAN).get("", _OFF)
        if self.said.number == before.number and self.said.stage_from_scan != before.stage_from_scan:
            self.box.follow(place, self.stage_from_scan)
        self._end_when_round()
        self._growing.take(client.latest(SCAN_PIECE), self.said.number)
        if self.active and self.said.number != before.number:
            self.shown = True
        bounds = self._growing.bounds if self.active else None
        if bounds is not None and self._framed != self.said.number and self.said.fused > _FRAMED:
            self._framed = self.said.number
            self._frame(bounds)
        if self.said.phase == "done" and before.phase in ("finishing", "scanning"):
            self._wanted = self.said.number, self.said.character
        if self._wanted is not None:
            self._keep(client.characters.get(self._wanted[1]), self._wanted[1])

    def _end_when_round(self) -> None:
        """Makes a character of a person a moment after the last side was seen: the keys are out of reach."""
        if self.said.thing != "person" or self.said.phase != "scanning" or self.said.missing > 0:
            self._round_ns = None
        elif self._round_ns is None:
            self._round_ns = self.said.time_ns
        elif self.said.time_ns - self._round_ns > _STANDS_NS:
            self._round_ns = None
            self.done()

    def _frame(self, bounds: Float) -> None:
        """Brings what grows into the picture."""
        place = self.stage_from_scan
        points = np.array([[x, y, z] for x in bounds[:, 0] for y in bounds[:, 1] for z in bounds[:, 2]])
        points = points @ place[:3, :3].T + place[:3, 3]
        camera = np.array(self.said.stage_from_camera).reshape(3, 4)[:, 3]
        # The camera will be all about it, and words stand above it.
        top = np.array([0.0, points[:, 1].max() + _WORDS, 0.0])
        points = np.vstack([points, camera, camera * [-1.0, 1.0, -1.0], top])
        aspect = self.editor.size[0] / max(self.editor.size[1], 1.0)
        self.editor.camera.frame((points.min(0), points.max(0)), aspect, room=0.85)

    def _keep(self, scanned: Character | None, name: str) -> None:
        """Makes what stands on the stage a character of the project: one edit, chosen and framed."""
        if scanned is None:
            return
        self._wanted = None
        mesh = Mesh(np.asarray(scanned.vertices, float), scanned.faces, name, scanned.colours)
        made = project_of_mesh(mesh, name)
        one = made.characters[name]
        ends, joints = (np.array(told).reshape(-1, 3) for told in (self.said.ends, self.said.joints))
        one = one.with_changes(ends=ends, joints=joints)
        known = name in self.editor.project.characters
        step = later("add to the scan {0}", name) if known else later("scan {0}", name)
        if not self.editor.edit(
            step,
            lambda project: project.with_streams(*made.streams.values()).with_characters(one),
        ):
            return
        self.perform.sender.stands(name, self.editor.project.characters[name])
        self.editor.choose(name)
        self.editor.frame_all()
        self.shown = False
        self.editor.toasts.say(
            tr("{0} stands on the stage", name),
            tr("Step in: press Possess, or P. Ctrl+Z takes the scan back."),
        )
        if self.said.note:
            self.editor.toasts.say(self.said.note, self.said.mend)
