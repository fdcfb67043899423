"""Pointer input on the rows of puppets: retiming key poses, contact switches, and hard constraints."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from enliven.document import Switch
from enliven.errors import EnlivenError
from enliven.examples.puppet_motion import solve_layer_motion
from enliven.modeling.edits import change_layers
from enliven_viewer.language import later
from enliven_viewer.studio.editor.editor import Edit, Editor
from enliven_viewer.studio.features.timeline.layout import LaneHandle, TimelineLayout
from enliven_viewer.studio.features.timeline.puppet_lanes import PuppetDetails
from enliven_viewer.studio.puppets.coverage import CoverageCache, TakeCoverage
from enliven_viewer.studio.puppets.example_edits import (
    add_switch,
    list_constraints,
    move_switch,
    remove_constraint_from,
    remove_switch,
    retime_pose,
)
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor

DRAG_TITLES = {"pose": later("retime a key pose"), "switch": later("move a switch")}
"""The name of each drag in the undo history."""


class PuppetRows:
    """Pointer input on the rows below a puppet's bars.

    Attributes:
        marked: the switch or constraint that the Delete key removes, or None.
        edit_pose: called with the number of a clicked key pose.
        begin_pose: called with a take and a time in it when a suggested key pose is clicked.
    """

    def __init__(self, editor: Editor, coverages: CoverageCache) -> None:
        self.editor, self.coverages = editor, coverages
        self.marked: LaneHandle | None = None
        self.edit_pose: Callable[[int], object] = get_puppet_editor(editor).edit_pose
        self.begin_pose: Callable[[str, float], object] = get_puppet_editor(editor).begin_pose
        self._switch_cache: tuple[object, dict[int, tuple[Switch, ...]]] = (None, {})

    @property
    def details(self) -> PuppetDetails:
        """Returns the current rows."""
        return PuppetDetails(get_puppet_editor(self.editor).puppet, self._find_coverage, self._find_switches)

    def press(self, handle: LaneHandle, layout: TimelineLayout, x: float) -> None:
        """Handles a press on a mark."""
        layer = self.details.layer(handle.number)
        self.marked = handle if handle.kind in ("switch", "held") else None
        if handle.kind == "suggested":
            coverage = self._find_coverage(layer.take)
            assert coverage is not None
            self.begin_pose(layer.take, coverage.times[handle.item])
        elif handle.kind == "found" and layer.switches is not None:
            self._edit(later("detect contacts again"), handle, switches=None)
        elif handle.kind == "held":
            frame = list_constraints(self.editor.project, handle.character, handle.number)[handle.item].frame
            take = self.editor.project.takes[layer.take]
            self.editor.scrub(layer.time_of(frame * take.step, take.duration))
        elif handle.kind == "band":
            self.editor.scrub(layout.time(x))

    def double_click(self, handle: LaneHandle) -> bool:
        """Handles a double click: on contacts and flight phases it adds a switch. Returns True if it had an
        effect.
        """
        if handle.kind != "band":
            return False
        take = self.editor.project.takes[self.details.layer(handle.number).take]
        frame = round(handle.seconds / take.step)
        switches = add_switch(self._find_switches(handle.number), frame, len(take.turns))
        self._edit(later("add a switch"), handle, switches=switches)
        return True

    def type(self, key: str) -> bool:
        """Handles the Delete key: removes the switch or constraint that was clicked last."""
        (handle, self.marked), puppet = (self.marked, None), get_puppet_editor(self.editor).puppet
        if handle is None or key not in ("delete", "backspace"):
            return False
        if puppet is None or puppet.id != handle.character or handle.number >= len(puppet.layers):
            return False
        if handle.kind == "switch":
            remaining = remove_switch(self._find_switches(handle.number), handle.item)
            self._edit(later("remove a switch"), handle, switches=remaining)
            return True
        constraints = list_constraints(self.editor.project, puppet.id, handle.number)
        if handle.item < len(constraints):
            constraint = constraints[handle.item]
            self.editor.edit(
                "remove constraint", lambda p: remove_constraint_from(p, puppet.id, handle.number, constraint)
            )
        return True

    def make_drag_edit(self, handle: LaneHandle, seconds: float, switches: tuple[Switch, ...]) -> Edit:
        """Returns the edit for dragging a mark to a time in the take.

        ``switches`` are the switches at the start of the drag.
        """
        if handle.kind == "pose":
            return lambda project: retime_pose(project, handle.character, handle.item, seconds)
        take = self.editor.project.takes[self.details.layer(handle.number).take]
        frame = round(seconds / take.step)
        return self._make_edit(handle, switches=move_switch(switches, handle.item, frame, len(take.turns)))

    def _edit(self, edit_name: str, handle: LaneHandle, **changes: Any) -> None:
        self.editor.edit(edit_name, self._make_edit(handle, **changes))

    def _make_edit(self, handle: LaneHandle, **changes: Any) -> Edit:
        return lambda project: change_layers(project, handle.character, [handle.number], **changes)

    def _find_coverage(self, take: str) -> TakeCoverage | None:
        puppet = get_puppet_editor(self.editor).puppet
        return self.coverages.find_coverage(self.editor.project, puppet, take) if puppet is not None else None

    def _find_switches(self, layer: int) -> tuple[Switch, ...]:
        """Returns a layer's edited switches, or the switches detected when the motion was last solved.
        Returns an empty tuple if the motion was never solved.
        """
        editor, puppet = self.editor, get_puppet_editor(self.editor).puppet
        if puppet is None or layer >= len(puppet.layers):
            return ()
        edited = puppet.layers[layer].switches
        if edited is not None:
            return edited
        project, shown = get_puppet_editor(editor).motion_solver.get_newest_solution(
            editor.project, puppet.id
        )
        if layer >= len(shown.layers) or shown.layers[layer].take != puppet.layers[layer].take:
            return ()
        if self._switch_cache[0] is not shown:
            self._switch_cache = (shown, {})
        switches_by_layer = self._switch_cache[1]
        if layer not in switches_by_layer:
            try:
                switches_by_layer[layer] = solve_layer_motion(project, shown, layer).switches
            except EnlivenError:
                switches_by_layer[layer] = ()
        return switches_by_layer[layer]
