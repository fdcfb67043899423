"""The parts of a skeleton that a performer's pose looks like (AniMesh, 2015)."""

from __future__ import annotations

from enliven.document import Skeleton
from enliven.matching import Matcher, Ranking, ScreenView, body_source
from enliven.person import Body


def match(
    body: Body,
    skeleton: Skeleton,
    parts: str = "all",
    *,
    view: ScreenView | None = None,
    body_view: ScreenView | None = None,
) -> Ranking:
    """The parts of a skeleton that a performer's pose could drive, the most alike on the screen first.

    Args:
        body: joints (20, 3) in metres of the world.
        skeleton: seen at rest.
        parts: parts of the body that choose: "arms", "left leg", ...
        view: from where the skeleton is seen; None looks along -Z, with +Y up.
        body_view: from where the body is seen; None as the skeleton. A view along +Z is a mirror.

    Returns:
        A sequence of matches with their scores; the best are kept, ``total`` counts all.

    Raises:
        InputError: for an unknown part of the body, or a skeleton without a bone.
    """
    source = body_source(body, parts).source
    return Matcher(skeleton).rank(source.points(body.joints), view or ScreenView(), body_view)
