"""The curve editor, with the curves of the selection.

Keys can be dragged, added, removed and eased with the pointer.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Project
from enliven.errors import EnlivenError
from enliven_viewer.language import later
from enliven_viewer.studio.app.lane_groups import find_lane_layers
from enliven_viewer.studio.app.time_axis import TimeAxis
from enliven_viewer.studio.editor.editor import Edit, Editor
from enliven_viewer.studio.features.animation.channels import (
    LAYER_KEY_ATTRIBUTES,
    CurveDot,
    CurveGroup,
    CurveSubject,
    find_layer_number,
    make_key_groups,
    make_layer_dots,
    make_pose_dots,
    sample_groups,
)
from enliven_viewer.studio.features.animation.curve_scale import Scale
from enliven_viewer.studio.features.animation.key_edits import (
    KEY_ATTRIBUTES,
    add_curve_key,
    describe_clamping,
    move_curve_key,
    remove_curve_key,
    set_interpolation,
)

GROUP_NAMES = ("keys", "moves", "turn", "place", "weight", "speed")
"""All groups of channels, in the order of their buttons."""
KEY_GRAB_DISTANCE_PX = 8.0
"""Distance in pixels within which a key can be grabbed."""
_CURVE_SAMPLES = 240
"""Number of samples of a curve over the visible time span: one every few pixels."""
_ZOOM_PER_NOTCH = 0.85
"""Factor of the visible value range per notch of the wheel."""


@dataclass(frozen=True, eq=False)
class _CurveRequest:
    """A request for sampled curves."""

    project: Project
    subject: CurveSubject
    start: float
    span: float

    def matches(self, other: _CurveRequest | None) -> bool:
        if other is None:
            return False
        return self.project is other.project and (self.subject, self.start, self.span) == (
            other.subject,
            other.start,
            other.span,
        )


_EASE_TITLES = {"smooth": later("smooth key"), "linear": later("linear key"), "step": later("step key")}
"""The name in the history of each change of a key's interpolation."""


class CurveInput:
    """The state of the curve editor, and the edits made with the pointer.

    Attributes:
        is_shown: whether the curves are shown.
        group: name of the shown group of channels.
        height: height of the curve area in pixels.
        selected_key: index of the key that was clicked last, or None.
    """

    def __init__(self, editor: Editor, axis: TimeAxis) -> None:
        self.editor, self.axis = editor, axis
        self.is_shown, self.group, self.height = False, "keys", 160.0
        self.selected_key: int | None = None
        self._scale: Scale | None = None
        self._last_group: tuple[CurveSubject | None, str] = (None, "")
        self._held_key: tuple[CurveDot, float, float, Scale] | None = None
        self._pool: ThreadPoolExecutor | None = None
        self._sampling: tuple[_CurveRequest, Future[dict[str, CurveGroup]]] | None = None
        self._samples: tuple[_CurveRequest, dict[str, CurveGroup]] | None = None
        self._key_groups: tuple[_CurveRequest, dict[str, CurveGroup]] | None = None

    def toggle(self) -> None:
        """Shows or hides the curves."""
        self.is_shown = not self.is_shown

    @property
    def subject(self) -> CurveSubject | None:
        """Returns the object of the curves: the selected character with its handle and layer.

        Returns None without a selection.
        """
        chosen = self.editor.find_selected()
        if chosen is None:
            return None
        return CurveSubject(chosen.id, self.editor.selection.handle, self.editor.selection.layer)

    @property
    def times(self) -> Float:
        """Returns the sample times (T,) in seconds, over the visible span of the timeline."""
        axis = self.axis.scale
        return np.linspace(axis.start, axis.start + axis.visible_s, _CURVE_SAMPLES)

    def refresh(self) -> None:
        """Fetches finished curves from the background thread, and starts sampling if they are outdated.

        Call once per frame; does not block.
        """
        subject = self.subject
        if subject is None:
            return
        self._collect_samples()
        axis, project = self.axis.scale, self.editor.project
        if self.editor.find_selected() is not None:
            kind = project.character(subject.character).kind
            project = self.editor.rig_editors[kind].find_shown(project, subject.character)[0]
        request = _CurveRequest(project, subject, axis.start, axis.visible_s)
        if self._sampling is None and not request.matches(self._samples[0] if self._samples else None):
            self._pool = self._pool or ThreadPoolExecutor(1, "curves")
            self._sampling = (request, self._pool.submit(sample_groups, project, subject, self.times))

    def groups(self) -> dict[str, CurveGroup]:
        """Returns all groups of curves of the selection that have already been sampled."""
        subject, project = self.subject, self.editor.project
        if subject is None:
            return {}
        is_current = self._samples is not None and self._samples[0].subject == subject
        groups = dict(self._samples[1]) if self._samples is not None and is_current else {}
        axis = self.axis.scale
        request = _CurveRequest(project, subject, axis.start, axis.visible_s)
        if self._key_groups is None or not request.matches(self._key_groups[0]):
            self._key_groups = (request, make_key_groups(project, subject, self.times))
        groups.update(self._key_groups[1])
        if "place" in groups and (dots := make_pose_dots(project, subject)):
            groups["place"] = replace(groups["place"], dots=dots)
        for name in LAYER_KEY_ATTRIBUTES:
            if name in groups:
                groups[name] = replace(groups[name], dots=make_layer_dots(project, subject, name))
        return {name: groups[name] for name in GROUP_NAMES if name in groups}

    def settle(self) -> dict[str, CurveGroup]:
        """Returns all groups of curves, completely solved and sampled.

        Blocks; for sessions without a window.
        """
        chosen = self.editor.find_selected()
        if chosen is not None:
            self.editor.rig_editors[chosen.kind].settle_motion(self.editor.project, chosen.id)
        self.refresh()
        while self._sampling is not None:
            wait_for([self._sampling[1]])
            self.refresh()
        return self.groups()

    def find_shown_group(self) -> CurveGroup | None:
        """Returns the shown group: the requested group, or the first available group."""
        groups = self.groups()
        return groups.get(self.group) or next(iter(groups.values()), None)

    def sample_times(self) -> Float:
        """Returns the sample times (T,) of :meth:`shown_group`, which may be slightly outdated."""
        if self._samples is None or self.find_shown_name() in KEY_ATTRIBUTES:
            return self.times
        return np.linspace(
            self._samples[0].start, self._samples[0].start + self._samples[0].span, _CURVE_SAMPLES
        )

    def find_shown_name(self) -> str:
        """Returns the name of the shown group, or empty."""
        group = self.find_shown_group()
        return "" if group is None else group.name

    def scale(self, group: CurveGroup) -> Scale:
        """Returns the value scale. It fits all values until the user zooms or pans."""
        if self._last_group != (self.subject, group.name):
            self._last_group, self._scale, self.selected_key = (self.subject, group.name), None, None
        if self._held_key is not None:
            return self._held_key[3]
        if self._scale is not None:
            return replace(self._scale, height=self.height)
        values = np.concatenate([group.values.ravel(), [dot.value for dot in group.dots]])
        return Scale.fit_values(values, group.unit, self.height)

    def fit_value_scale(self) -> None:
        """Fits the value scale to all values again."""
        self._scale = None

    def zoom(self, notches: float, y: float) -> None:
        """Zooms the value range in or out around a pixel."""
        group = self.find_shown_group()
        if group is not None:
            self._scale = self.scale(group).zoom(_ZOOM_PER_NOTCH**notches, y)

    def pan(self, pixels: float) -> None:
        """Pans the values down by some pixels."""
        group = self.find_shown_group()
        if group is not None:
            self._scale = self.scale(group).pan(pixels)

    def find_dot(self, x: float, y: float) -> CurveDot | None:
        """Returns the key at a pixel. x is measured from the timeline's left, y from the top of
        the curves.
        """
        group = self.find_shown_group()
        if group is None:
            return None
        axis, scale = self.axis.scale, self.scale(group)
        near = [
            (float(np.hypot(axis.x(dot.time) - x, scale.y(dot.value) - y)), dot.number, dot.axis, dot)
            for dot in group.dots
        ]
        best = min(near, default=None, key=lambda candidate: candidate[:3])
        return best[3] if best is not None and best[0] <= KEY_GRAB_DISTANCE_PX else None

    def press(self, x: float, y: float) -> None:
        """Handles a press of the left button: grabs a key, otherwise moves the playhead."""
        dot, group = self.find_dot(x, y), self.find_shown_group()
        self.selected_key = None if dot is None else dot.number
        if dot is not None and group is not None:
            self._held_key = (dot, x, y, self.scale(group))
        elif group is not None:
            self.editor.scrub(self.axis.scale.time(x))

    def drag(self, x: float, y: float) -> None:
        """Handles pointer movement: previews the move of the held key."""
        if self._held_key is not None:
            self.editor.preview_edit(self._move_edit(x, y))

    def release(self, x: float, y: float) -> None:
        """Handles the release of the button: the drag becomes one edit."""
        held = self._held_key
        if held is not None and self.editor.draft is not None:
            if self.subject is not None:
                self._warn_if_clamped(self.subject, self.find_shown_name(), *self._drag_target(x, y))
            self.editor.edit("move key", self._move_edit(x, y))
        self.editor.draft, self._held_key = None, None
        dot = self.find_dot(x, y)
        # Keys are numbered by time. So dragging a key past another key changes its number.
        self.selected_key = self.selected_key if dot is None else dot.number

    @property
    def busy(self) -> bool:
        """Returns True if a key is being dragged."""
        return self._held_key is not None

    def double_click(self, x: float, y: float) -> None:
        """Handles a double click: adds a key with the value at the pointer to the nearest channel."""
        subject, group = self.subject, self.find_shown_group()
        if subject is None or group is None or group.name not in (*KEY_ATTRIBUTES, *LAYER_KEY_ATTRIBUTES):
            return
        if self.find_dot(x, y) is not None:
            return
        name, time, value = group.name, self.axis.scale.time(x), self.scale(group).value(y)
        self._warn_if_clamped(subject, name, time, value)
        self.editor.edit(
            "set key", lambda p: add_curve_key(p, subject, self._find_lane(subject), name, time, value)
        )

    def remove(self) -> None:
        """Removes the selected key."""
        subject, number, name = self.subject, self.selected_key, self.find_shown_name()
        if subject is None or number is None:
            return
        self.selected_key = None
        edit_name = (
            later("remove key")
            if name in (*KEY_ATTRIBUTES, *LAYER_KEY_ATTRIBUTES)
            else later("remove key pose")
        )
        self.editor.edit(
            edit_name, lambda p: remove_curve_key(p, subject, self._find_lane(subject), name, number)
        )

    def handle_key(self, key: str) -> bool:
        """Handles keyboard input for the selected key: Delete removes it.

        Returns True if it had an effect.
        """
        if not self.is_shown or self.selected_key is None or key not in ("delete", "backspace"):
            return False
        self.remove()
        return True

    def set_interpolation(self, ease: str) -> None:
        """Changes the interpolation from the selected key to the next one."""
        subject, number, name = self.subject, self.selected_key, self.find_shown_name()
        if subject is not None and number is not None:
            self.editor.edit(
                _EASE_TITLES[ease],
                lambda p: set_interpolation(p, subject, self._find_lane(subject), name, number, ease),
            )

    def _find_lane(self, subject: CurveSubject) -> tuple[int, ...]:
        """Returns the numbers of the layers in the same timeline row (lane) as the object's layer, which
        comes first.
        """
        number = find_layer_number(self.editor.project, subject) or 0
        layers = find_lane_layers(self.editor.project, subject.character, number)
        return (number, *(layer for layer in layers if layer != number))

    def _warn_if_clamped(self, subject: CurveSubject, name: str, time: float, value: float) -> None:
        """Shows a message if a value is outside the playable range and is therefore clamped."""
        if warning := describe_clamping(self.editor.project, subject, name, time, value):
            self.editor.toasts.show_message(warning)

    def _drag_target(self, x: float, y: float) -> tuple[float, float]:
        """Returns the time and the value to which the pointer drags the held key."""
        assert self._held_key is not None
        dot, from_x, from_y, scale = self._held_key
        axis = self.axis.scale
        time = dot.time + axis.time(x) - axis.time(from_x)
        value = dot.value + scale.value(y) - scale.value(from_y)
        # A drag along one axis keeps the value on the other axis.
        return (
            dot.time if abs(x - from_x) < KEY_GRAB_DISTANCE_PX / 2 else time,
            dot.value if abs(y - from_y) < KEY_GRAB_DISTANCE_PX / 2 else value,
        )

    def _move_edit(self, x: float, y: float) -> Edit:
        """Returns the edit that moves the held key to a pixel."""
        assert self._held_key is not None
        subject, name, dot, (time, value) = (
            self.subject,
            self.find_shown_name(),
            self._held_key[0],
            self._drag_target(x, y),
        )
        assert subject is not None
        lane = self._find_lane(subject)
        return lambda project: move_curve_key(project, subject, lane, name, dot, time, value)

    def _collect_samples(self) -> None:
        """Fetches the finished curves from the background thread."""
        if self._sampling is None or not self._sampling[1].done():
            return
        (request, future), self._sampling = self._sampling, None
        error = future.exception()
        if error is not None and not isinstance(error, EnlivenError):
            # Report only internal errors here. The panel that plays the character reports all others.
            self.editor.toasts.show_any_error(error)
        self._samples = (request, {} if error is not None else future.result())
