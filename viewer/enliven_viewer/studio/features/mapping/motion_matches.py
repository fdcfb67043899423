"""Ranks the parts of a shape that a take could drive, based on both views, and applies a chosen match."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.arrays import Float
from enliven.document import Clip, Project, RiggedCharacter
from enliven.matching.ranking import Matcher
from enliven.matching.source import source_of_skeleton
from enliven.motion.layers.retarget import bind_chain
from enliven_viewer.studio.features.mapping.source_view import pose_take
from enliven_viewer.studio.viewport.picking import Lens, make_match_view

Chain = tuple[int, ...]


@dataclass(frozen=True)
class MotionMatch:
    """A match: pairs of a chain of the take and the chain of the shape that it drives, and a similarity
    score.
    """

    shape: str
    take: str
    pairs: tuple[tuple[Chain, Chain], ...]
    score: float

    @property
    def joints(self) -> Chain:
        """Returns all joints of the shape that would move."""
        return tuple(sorted({joint for _, target in self.pairs for joint in target}))


def rank_matches(
    clip: Clip,
    time: float,
    shape: RiggedCharacter,
    joints: Float,
    lens: Lens,
    source_lens: Lens,
    max_matches: int,
) -> list[MotionMatch]:
    """Returns the best matches of a take's pose at a time with a shape that has the joints ``joints`` (N, 3).
    Both are compared as projected in their views.

    Raises:
        InputError: if one of the skeletons cannot be abstracted.
    """
    source = source_of_skeleton(clip.skeleton)
    pose = pose_take(clip, time).handles
    ranking = Matcher(shape.skeleton).rank(
        source.points(pose), make_match_view(lens), make_match_view(source_lens), positions=joints
    )
    best_offers: list[MotionMatch] = []
    for match in ranking:
        pairs = tuple(
            (chain, branch.extended)
            for chain, branch in zip(source.chains, match.pairs, strict=True)
            if branch is not None
        )
        if pairs and all(offer.pairs != pairs for offer in best_offers):
            best_offers.append(MotionMatch(shape.id, clip.id, pairs, match.score))
        if len(best_offers) == max_matches:
            break
    return best_offers


def apply_match(project: Project, offer: MotionMatch, lens: Lens, source_lens: Lens, loop: bool) -> Project:
    """Returns the project with a layer for every chain of a match, so that the take drives it."""
    for source, target in offer.pairs:
        project = bind_chain(
            project,
            offer.shape,
            target,
            offer.take,
            source,
            view=lens.forward,
            up=lens.up,
            source_view=source_lens.forward,
            source_up=source_lens.up,
            loop=loop,
            hold=False,
        )
    return project
