"""Trees for the tests of matching: random ones, and that of AniMesh's Figure 3, reconstructed from its
text.
"""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st


@st.composite
def trees(draw, least=2, most=24):
    """Draws (N, 3) positions and links, in random order and direction. Some trees contain long chains."""
    count = draw(st.integers(least, most))
    back = draw(st.lists(st.integers(0, 6), min_size=count - 1, max_size=count - 1))
    links = [(max(0, joint - 1 - step), joint) for joint, step in enumerate(back, 1)]
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    positions = rng.normal(size=(count, 3))
    names = rng.permutation(count)
    placed = np.empty_like(positions)
    placed[names] = positions
    mixed = [(int(names[a]), int(names[b]))[:: rng.choice([1, -1])] for a, b in links]
    return placed, [mixed[i] for i in rng.permutation(len(mixed))]


class Drawing:
    """A tree under construction, built limb by limb."""

    def __init__(self):
        self.points, self.links = [], []

    def limb(self, start, *points):
        """Adds joints one after another to ``start`` (or to nothing), and returns the last one."""
        for point in points:
            if start is not None:
                self.links.append((start, len(self.points)))
            start = len(self.points)
            self.points.append((*point, 0.0))
        return start


def figure_three():
    """Returns positions, links, and the joints that the text names.

    Two branch nodes p and q are joined by a chain that contains the root. A smaller branch node is attached
    to each by a chain (the roots of 1-1 and 1-2, green in the figure). The four candidates have 16 choices of
    two branches in total only if they have 2, 3, 4 and 4 branches, as a test shows.
    """
    tree = Drawing()
    p = tree.limb(None, (-2.0, 0.0))
    black = tree.limb(p, (-1.0, 0.1), (0.05, 0.15))
    q = tree.limb(black, (1.0, 0.1), (2.0, 0.0))
    for end in ((-2.6, -0.9), (-2.0, -1.0), (-1.4, -0.9)):
        tree.limb(p, ((end[0] - 2.0) / 2, end[1] / 2), end)
    left_node = tree.limb(p, (-2.5, 0.5), (-3.0, 1.0))
    for end in ((-3.6, 1.2), (-3.2, 1.6), (-2.6, 1.5)):
        tree.limb(left_node, end)
    for end in ((1.4, -0.9), (2.0, -1.1), (2.6, -0.9)):
        tree.limb(q, ((end[0] + 2.0) / 2, end[1] / 2), end)
    right_node = tree.limb(q, (2.5, 0.5), (3.0, 1.0))
    for end in ((2.2, 1.2), (3.8, 1.2)):
        tree.limb(right_node, ((end[0] + 3.0) / 2, (end[1] + 1.0) / 2), end)
    return (
        np.array(tree.points),
        tree.links,
        {"p": p, "q": q, "1-1": left_node, "1-2": right_node, "root": black},
    )
