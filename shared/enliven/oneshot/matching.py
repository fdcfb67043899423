"""Finds the parts of a skeleton that resemble a performer's pose (AniMesh, 2015)."""

from __future__ import annotations

from enliven.document import Skeleton
from enliven.matching.body_limbs import body_source
from enliven.matching.matches import Ranking
from enliven.matching.ranking import Matcher
from enliven.matching.views import ScreenView
from enliven.person import Body


def match(
    body: Body,
    skeleton: Skeleton,
    parts: str = "all",
    *,
    view: ScreenView | None = None,
    body_view: ScreenView | None = None,
) -> Ranking:
    """Ranks the parts of a skeleton that a pose could drive, the most similar on the screen first.

    Args:
        body: the performer, with joints (20, 3) in metres in the world.
        skeleton: the skeleton in its rest pose.
        parts: the parts of the body that are matched: "arms", "left leg", ...
        view: view of the skeleton. None looks along -Z, with +Y up.
        body_view: view of the body. None means the view of the skeleton. A view along +Z acts as a mirror.

    Returns:
        A sequence of the best matches with their scores. ``total`` is the number of all matches.

    Raises:
        InputError: if a body part is unknown, or the skeleton has no bone.
    """
    source = body_source(body, parts).source
    return Matcher(skeleton).rank(source.points(body.joints), view or ScreenView(), body_view)
