"""The retargeting tool: maps chains of a take to chains of a shape, or accepts a suggested match."""

from __future__ import annotations

from dataclasses import dataclass, replace

from enliven.document import Clip, Project, RiggedCharacter
from enliven.errors import EnlivenError, InputError
from enliven.mapping.automatic_mapping import RetargetedShape, create_automatic_plan, play_own_take, retarget
from enliven.mapping.model_clips import find_played_clip, is_own_take, list_own_clips, loop_takes, mute_takes
from enliven.mapping.plan import Plan
from enliven.mapping.quality import MotionQuality, measure_quality
from enliven.mapping.softening import soften_plan
from enliven.motion.layers.polyline import is_downward
from enliven.motion.layers.retarget import bind_chain
from enliven_viewer.language import later, tr, tr_n
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.mapping.motion_matches import (
    Chain,
    MotionMatch,
    apply_match,
    rank_matches,
)
from enliven_viewer.studio.features.mapping.source_view import SourceView
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.viewport.overlay import Overlay

_MAX_MATCHES = 6
"""Maximum number of thumbnails of matches. They fit into one row."""


@dataclass(frozen=True)
class MappedChain:
    """The chains that were mapped last, which the user can flip."""

    shape: str
    target: Chain
    take: str
    source: Chain
    flip: bool


@dataclass
class WholeBody:
    """The settings of a whole-body retargeting. Their meaning is documented in :class:`Plan`."""

    floor: bool = True
    steps: bool = True
    travel: bool = False
    pin: bool = False
    stretch: bool = False
    limits: bool = True


class MapTool(Tool):
    """A tool that transfers the motion of a chain of a take to a chain of a shape.

    Attributes:
        source: the view of the take.
        loop: whether newly mapped motion loops.
        whole_body: settings of whole-body retargeting.
        gentle: if True, limbs that would stretch the surface move less.
        last_mapping: the last whole-body retargeting: shape, take, plan, and quality.
        offered: suggested matches, which a click accepts. The first match is highlighted by default.
    """

    name, label, key, icon = "map", "Map motion", "m", "\uf0ec"
    hides_performer = True

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self.source = SourceView(editor)
        self.loop = True
        self.offered: list[MotionMatch] = []
        self.highlighted: MotionMatch | None = None
        self.whole_body, self.gentle = WholeBody(), False
        self.last_mapping: tuple[str, str, Plan, MotionQuality] | None = None
        self._chain_start: tuple[str, int] | None = None
        self._last_chain: MappedChain | None = None

    @property
    def hint(self) -> str:
        """Returns the next step: choose a take, choose a chain of it, or click the ends of a chain of the
        shape.
        """
        if self.source.clip is None:
            return "Choose a take in the Source view."
        if self.source.is_choosing or not self.source.chain:
            return "In the Source view, click the first joint of a chain, then the last joint."
        if self._chain_start is not None:
            return "Click the last joint of the chain on your shape."
        tail = tr("  Y flips the last mapping.") if self._last_chain else ""
        return tr("On your shape, click the first joint of a chain, then the last joint.") + tail

    def press(self, pointer: Pointer) -> bool:
        """Stores the first joint of a chain. The second click selects the chain, and maps the take's chain to
        it.

        Returns False for a click on no joint, so that the drag turns the view.
        """
        hit = self.handle_at(pointer)
        if hit is None or not self.editor.stage_character(hit.character).bones:
            return False
        self.editor.select(character=hit.character)
        if self._chain_start is None or self._chain_start[0] != hit.character:
            self._chain_start = (hit.character, hit.handle)
            self.editor.select(handle=hit.handle, chain=(hit.handle,))
            return True
        skeleton = self.editor.project.shape(hit.character).skeleton
        chain = skeleton.path(self._chain_start[1], hit.handle)
        self._chain_start = None
        if len(chain) > 1 and not is_downward(skeleton, chain) and is_downward(skeleton, chain[::-1]):
            chain = chain[::-1]
        self.editor.select(handle=None, chain=chain)
        if self.source.take is not None and self.source.chain:
            self._map_chain(MappedChain(hit.character, chain, self.source.take, self.source.chain, False))
        return True

    def type(self, key: str) -> bool:
        """Maps the last chain in the opposite direction for the key Y."""
        if key == "y" and self._last_chain is not None:
            last = self._last_chain
            self.editor.undo()
            self._map_chain(MappedChain(last.shape, last.target, last.take, last.source, not last.flip))
            return True
        return False

    def cancel(self) -> None:
        """Forgets the chosen joints on the shape and the chosen chain of the take."""
        super().cancel()
        self._chain_start = None
        self.source.forget()

    def overlay(self) -> Overlay:
        """Returns the usual marks. A highlighted match replaces the selected chain."""
        base_overlay = super().overlay()
        if self.highlighted is not None:
            return Overlay(
                base_overlay.marks, (self.highlighted.shape, self.highlighted.joints), base_overlay.hovered
            )
        return base_overlay

    def rank(self) -> None:
        """Finds matches between the take's current pose and the selected shape.

        Both are compared as projected in their views.
        """
        clip, shape = self.source.clip, self.editor.find_selected(RiggedCharacter)
        self.offered = []
        if clip is None or shape is None:
            return
        editor = self.editor
        try:
            time = editor.time % max(clip.duration, clip.step)
            posed = editor.stage_character(shape.id)
            self.offered = rank_matches(
                clip, time, shape, posed.handles, editor.lens, self.source.lens, _MAX_MATCHES
            )
        except EnlivenError as error:
            editor.toasts.show_error(error)

    def map_whole(self) -> None:
        """Retargets the whole take: maps every limb to a suitable limb of the selected shape."""
        editor, clip, shape = self.editor, self.source.clip, self.editor.find_selected(RiggedCharacter)
        if clip is None or shape is None:
            editor.toasts.show_message(
                tr("Nothing to map"), tr("Choose a take, and click the shape that should move.")
            )
            return

        old_project, gentle, loop = editor.project, self.gentle, self.loop
        plan = replace(create_automatic_plan(clip, shape), **vars(self.whole_body))
        if not (is_own_take(clip, shape) or plan.chains):
            remedy = tr("Map the take chain by chain, or press Matches at another moment of the take.")
            error = InputError(
                tr("no limb of the take fits a limb of the shape"), where=clip.id, remedy=remedy
            )
            editor.toasts.show_error(error)
            return

        def fitted(project: Project) -> RetargetedShape:
            return _replace_motion(project, shape, clip, plan, gentle=gentle, loop=loop)

        def work() -> tuple[RetargetedShape, MotionQuality]:
            retargeted = fitted(old_project)
            return retargeted, measure_quality(
                retargeted.project, retargeted.shape_id, clip, retargeted.duration, retargeted.plan
            )

        def then(fitted_take: tuple[RetargetedShape, MotionQuality]) -> None:
            retargeted, quality = fitted_take

            def change(project: Project) -> Project:
                return retargeted.project if project is old_project else fitted(project).project

            if editor.edit(later("map all of {0}", clip.id), change):
                self._last_chain, self.last_mapping = None, (shape.id, clip.id, retargeted.plan, quality)
                editor.toasts.show_message(
                    tr("{0} now moves the whole shape {1}", clip.id, shape.id),
                    tr("Space plays the motion, Ctrl+Z undoes the mapping.")
                    + _describe_limited_joints(len(retargeted.limited)),
                )

        editor.background.begin(tr("Fitting {0} to {1}", clip.id, shape.id), work, then)

    def accept(self, offer: MotionMatch) -> None:
        """Maps every chain of a suggested match."""
        editor, lens, other = self.editor, self.editor.lens, self.source.lens
        if editor.edit(
            later("map {0}", offer.take),
            lambda p: apply_match(_remove_clip(p, offer.shape), offer, lens, other, self.loop),
        ):
            self._last_chain = None
            count = len(offer.pairs)
            editor.toasts.show_message(
                tr_n(
                    "{1} drives {0} chain of {2}",
                    "{1} drives {0} chains of {2}",
                    count,
                    offer.take,
                    offer.shape,
                )
            )

    def _map_chain(self, mapping: MappedChain) -> None:
        """Maps one chain to another, as both are currently projected in their views."""
        lens, other = self.editor.lens, self.source.lens

        def change(project: Project) -> Project:
            return bind_chain(
                _remove_clip(project, mapping.shape),
                mapping.shape,
                mapping.target,
                mapping.take,
                mapping.source,
                view=lens.forward,
                up=lens.up,
                source_view=other.forward,
                source_up=other.up,
                flip=mapping.flip,
                loop=self.loop,
                hold=False,
            )

        if self.editor.edit(later("map {0}", mapping.take), change):
            self._last_chain = mapping
            bones = max(len(mapping.target) - 1, 1)
            message = tr_n(
                "{1} moves {0} bone of {2}", "{1} moves {0} bones of {2}", bones, mapping.take, mapping.shape
            )
            self.editor.toasts.show_message(message, tr("Space plays the motion, Y flips the motion."))


def _remove_clip(project: Project, shape_id: str) -> Project:
    """Returns a project in which a shape no longer plays its own clip.

    Otherwise new motion would be added to the clip's motion.
    """
    plays = find_played_clip(project, project.shape(shape_id)) is not None
    return mute_takes(project, shape_id) if plays else project


def _replace_motion(
    project: Project, shape: RiggedCharacter, clip: Clip, plan: Plan, *, gentle: bool, loop: bool
) -> RetargetedShape:
    """Returns the shape with the take in place of its previous motion.

    Args:
        gentle: limbs that would stretch the surface move less.
        loop: the take repeats.
    """
    muted = mute_takes(project, shape.id)
    still_shape = muted.shape(shape.id)
    if is_own_take(clip, shape):
        retargeted = play_own_take(still_shape, clip, muted)
    else:
        used_plan = soften_plan(plan, clip, still_shape) if gentle else plan
        clips = [project.takes[name] for name in list_own_clips(project, project.shape(shape.id))]
        retargeted = retarget(still_shape, clip, used_plan, muted, clips)
    return replace(retargeted, project=loop_takes(retargeted.project, shape.id)) if loop else retargeted


def _describe_limited_joints(count: int) -> str:
    """Returns a sentence with a space before it, or an empty text if no joint was limited."""
    if not count:
        return ""
    return " " + tr_n(
        "{0} joint was kept within its limits.", "{0} joints were kept within their limits.", count
    )
