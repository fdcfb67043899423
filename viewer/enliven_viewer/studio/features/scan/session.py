"""A scan in the studio: sends requests to the edge, shows the progress, and adds the resulting character to
the project.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from enliven.arrays import Float
from enliven.document import Character
from enliven.formats.project.one_character import project_of_mesh
from enliven.meshes import Mesh
from enliven.wire import SCAN, SCAN_PIECE, Answer, Refused, Scan, ScanMessage, ScanMode
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.actions import NO_STAGE
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.scan.crop_box import CropBox, find_initial_box
from enliven_viewer.studio.features.scan.preview import ScanPreview, ScanPreviewMesh
from enliven_viewer.studio.viewport.overlay import Point

ScanSize = Literal["thing", "small", "room"]
KeptPart = Literal["thing", "box", "all"]
VOXEL_SIZES: dict[ScanSize, float] = {"small": 0.002, "thing": 0.004, "room": 0.01}
"""Voxel size in metres for each size class: such as a cup, a chair, a room."""
_PERSON_VOXEL_M = 0.008
"""Voxel size in metres for a person two metres away. With smaller voxels, tracking the person's rotation
often fails.
"""
_MAX_DISTANCE_M = 1.5
"""Maximum distance in metres from a fixed camera when the object is turned in front of it."""
_DRAWN_OFFSET_M = 0.012
"""Height offset in metres of the drawn scan, so that its floor hides the floor of the stage."""
_TEXT_SPACE_M = 0.5
"""Space in metres above the scan that stays free for the instructions."""
_FRAMING_IMAGES = 8
"""Number of fused images after which the camera frames the scan. By then the centre of the
object is known.
"""
_HOLD_STILL_NS = 1_000_000_000
"""Nanoseconds for which a person stands still after the last side came into view, before the scan becomes a
character. They are measured on the sensor's clock, so that they do not depend on the edge's speed.
"""
_NO_SCAN = ScanMessage()


class ScanSession:
    """The studio's view of the scan that the edge makes.

    Args:
        editor: the editor; the scanned object becomes a character of its project.
        perform: the session that is connected to the edge.

    Attributes:
        is_shown: whether the panel is open.
        message: the progress of the scan, as reported by the edge.
        size: the size class of the object.
        mode: how camera and object move during the scan. A scan of a person ends by itself once all sides
            were seen.
        kept_part: the part of the scan that becomes the character: the object on the floor, the content of
            the box, or everything.
        box: the crop box that the artist drags.
        name: name of the new character; empty to let the edge choose one.
    """

    def __init__(self, editor: Editor, perform: PerformSession) -> None:
        self.editor, self.perform = editor, perform
        self.is_shown = False
        self.mode = ScanMode.AROUND
        self.kept_part: KeptPart = "thing"
        self.box = CropBox()
        self.size: ScanSize = "thing"
        self.name = ""
        self.message = _NO_SCAN
        self._preview_mesh = ScanPreviewMesh()
        self._awaited_character: tuple[int, str] | None = None
        self._framed_scan = -1
        self._complete_since_ns: int | None = None

    @property
    def active(self) -> bool:
        """Returns True if a scan is running on the edge."""
        return self.message.phase in ("scanning", "paused", "finishing", "failed")

    @property
    def surface(self) -> tuple[ScanPreview, Float] | None:
        """Returns the preview surface and its (4, 4) transform to the stage, or None without a surface."""
        if not self.active or self._preview_mesh.picture is None:
            return None
        return self._preview_mesh.picture, self.stage_from_scan

    @property
    def stage_from_scan(self) -> Float:
        """Returns the (4, 4) transform from the scan's world to the stage."""
        place = np.vstack([np.array(self.message.stage_from_scan).reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
        place[1, 3] += _DRAWN_OFFSET_M
        return place

    # Requests ---------------------------------------------------------------------------------------------

    def describe_missing_stage(self) -> str:
        """Returns the reason why scanning is unavailable, with advice, or an empty text if it
        is available.
        """
        if self.perform.client is None:
            return NO_STAGE
        return self.perform.describe_missing_edge()

    def describe_missing_scan(self) -> str:
        """Returns the reason why the scan accepts no requests, or an empty text if it accepts them."""
        none = "" if self.active else "No scan is running. Start a scan first"
        making = (
            "The character is being made. Wait until the character is on the stage"
            if self.message.phase == "finishing"
            else ""
        )
        return self.describe_missing_stage() or none or making

    def describe_missing_undo(self) -> str:
        """Returns the reason why nothing can be undone, or an empty text if undo is available."""
        return self.describe_missing_scan() or (
            "" if self.message.undoable > 0 else "There is nothing to undo. Continue the scan"
        )

    def describe_missing_repeat(self) -> str:
        """Returns the reason why no scan can be continued, or an empty text if one can be continued."""
        is_done = self.message.phase == "done"
        return self.describe_missing_stage() or (
            "" if is_done else "No scan is finished. Finish a scan, then add to it"
        )

    def open(self) -> None:
        """Shows the panel, in the workspace that contains the stage."""
        self.perform.active_workspace, self.is_shown = "Perform", True

    def start(self) -> None:
        """Starts a scan."""
        self.open()
        if lacking := self.describe_missing_stage():
            self.editor.toasts.show_message(*tr(lacking).split(". "))
            return
        within = _MAX_DISTANCE_M if self.mode is ScanMode.NEAR else None
        voxel = _PERSON_VOXEL_M if self.mode is ScanMode.PERSON else VOXEL_SIZES[self.size]
        self._send_request(Scan("start", self.name.strip() or None, voxel, within, mode=self.mode))

    def pause(self) -> None:
        """Pauses or resumes the scan."""
        self._send_request(Scan("pause" if self.message.phase == "scanning" else "go on"))

    def continue_scan(self) -> None:
        """Continues a finished scan, so that new images are added to it."""
        self.open()
        self._send_request(Scan("go on"))

    def undo(self) -> None:
        """Undoes the last seconds of the scan."""
        self._send_request(Scan("undo"))

    def finish(self) -> None:
        """Finishes the scan and makes a character of it."""
        if self.kept_part != "box":
            self._send_request(Scan("done", whole=self.kept_part == "all"))
            return
        corners = [float(x) for x in self.box.corners.ravel()]
        self._send_request(Scan("done", box=corners, stage_from_scan=list(self.message.stage_from_scan)))

    def cancel(self) -> None:
        """Cancels the scan and discards it."""
        self._send_request(Scan("cancel"))

    def choose_kept_part(self, kept_part: KeptPart) -> None:
        """Chooses the part of the scan that becomes the character. A box is initially fitted around the
        object at the centre.
        """
        if kept_part == "box" and self.kept_part != "box":
            self.fit_box()
        self.kept_part = kept_part

    def fit_box(self) -> None:
        """Fits the box around the object at the centre of the stage."""
        grown, place = self._preview_mesh.picture, self.stage_from_scan
        points = np.zeros((0, 3)) if grown is None else np.asarray(grown.vertices, float)
        self.box.corners = find_initial_box(points @ place[:3, :3].T + place[:3, 3])

    @property
    def has_crop_box(self) -> bool:
        """Returns True if the box is shown and can be dragged."""
        return self.active and self.message.phase != "finishing" and self.kept_part == "box"

    # The box's handles over the view ---------------------------------------------------------------------

    def press(self, at: Point) -> bool:
        """Handles a press of the left button over the view. Returns True if a side of the box was grabbed."""
        return self.has_crop_box and self.box.press(at, self.editor.lens)

    def drag(self, at: Point) -> None:
        """Handles pointer movement while a side is dragged."""
        self.box.drag(at, self.editor.lens)

    def release(self) -> None:
        """Handles the release of the button."""
        self.box.release()

    def _send_request(self, order: Scan) -> None:
        client = self.perform.client
        if client is not None:
            client.ask(order, self._handle_answer)

    def _handle_answer(self, answer: Answer) -> None:
        if isinstance(answer, Refused):
            problem, _, remedy = answer.reason.removeprefix("scan: ").partition(". ")
            self.editor.toasts.show_message(problem[:1].upper() + problem[1:], remedy)

    # Once per frame ---------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Reads the newest messages of the edge."""
        client = self.perform.client
        if client is None:
            self.message = _NO_SCAN
            return
        client.take(SCAN)
        client.take(SCAN_PIECE)
        old_message, place = self.message, self.stage_from_scan
        self.message = client.latest(SCAN).get("", _NO_SCAN)
        if (
            self.message.number == old_message.number
            and self.message.stage_from_scan != old_message.stage_from_scan
        ):
            self.box.move_with_scan(place, self.stage_from_scan)
        self._finish_person_scan()
        self._preview_mesh.update(client.latest(SCAN_PIECE), self.message.number)
        if self.active and self.message.number != old_message.number:
            self.is_shown = True
        bounds = self._preview_mesh.bounds if self.active else None
        if (
            bounds is not None
            and self._framed_scan != self.message.number
            and self.message.fused > _FRAMING_IMAGES
        ):
            self._framed_scan = self.message.number
            self._frame_surface(bounds)
        if self.message.phase == "done" and old_message.phase in ("finishing", "scanning"):
            self._awaited_character = self.message.number, self.message.character
        if self._awaited_character is not None:
            self._add_to_project(
                client.characters.get(self._awaited_character[1]), self._awaited_character[1]
            )

    def _finish_person_scan(self) -> None:
        """Finishes the scan of a person shortly after the last side was seen, because the person cannot reach
        the keyboard.
        """
        if self.message.thing != "person" or self.message.phase != "scanning" or self.message.missing > 0:
            self._complete_since_ns = None
        elif self._complete_since_ns is None:
            self._complete_since_ns = self.message.time_ns
        elif self.message.time_ns - self._complete_since_ns > _HOLD_STILL_NS:
            self._complete_since_ns = None
            self.finish()

    def _frame_surface(self, bounds: Float) -> None:
        """Moves the view so that the growing surface is visible."""
        place = self.stage_from_scan
        points = np.array([[x, y, z] for x in bounds[:, 0] for y in bounds[:, 1] for z in bounds[:, 2]])
        points = points @ place[:3, :3].T + place[:3, 3]
        camera = np.array(self.message.stage_from_camera).reshape(3, 4)[:, 3]
        # Leave room for the camera on all sides of the scan, and for the instructions above it.
        top = np.array([0.0, points[:, 1].max() + _TEXT_SPACE_M, 0.0])
        points = np.vstack([points, camera, camera * [-1.0, 1.0, -1.0], top])
        aspect = self.editor.size[0] / max(self.editor.size[1], 1.0)
        self.editor.camera.frame((points.min(0), points.max(0)), aspect, margin=0.85)

    def _add_to_project(self, scanned: Character | None, name: str) -> None:
        """Adds the scanned character on the stage to the project as one edit, selects it, and frames it."""
        if scanned is None:
            return
        self._awaited_character = None
        mesh = Mesh(np.asarray(scanned.vertices, float), scanned.faces, name, scanned.colours)
        scan_project = project_of_mesh(mesh, name)
        shape = scan_project.characters[name]
        ends, joints = (
            np.array(points).reshape(-1, 3) for points in (self.message.ends, self.message.joints)
        )
        shape = shape.with_changes(ends=ends, joints=joints)
        is_present = name in self.editor.project.characters
        step = later("add to the scan {0}", name) if is_present else later("scan {0}", name)
        if not self.editor.edit(
            step,
            lambda project: project.with_streams(*scan_project.streams.values()).with_characters(shape),
        ):
            return
        self.perform.staged.sender.mark_sent(name, self.editor.project.characters[name])
        self.editor.select_only(name)
        self.editor.frame_all()
        self.is_shown = False
        self.editor.toasts.show_message(
            tr("{0} is on the stage", name),
            tr("Press Possess, or P, to step in. Ctrl+Z undoes the scan."),
        )
        if self.message.note:
            self.editor.toasts.show_message(self.message.note, self.message.remedy)
