"""Several people: stable identities through crossing, touching, hiding, leaving and coming back."""

from enliven_edge.tracking.tracker import Tracker


def ids_of(log, player):
    """The ids that a player ever had."""
    return {who[player] for _, _, who in log} - {None}


def test_two_people_who_cross_keep_their_identities(stagecraft):
    s = stagecraft
    front = s.Player(s.line((-0.9, -2.2), (0.9, -2.2), 0.2, 2.2), "walk", s.Proportions(height=1.7))
    behind = s.Player(s.line((1.0, -3.0), (-1.0, -3.0), 0.2, 2.2), "walk", s.Proportions(height=1.82))
    log = s.watch(s.Playground(front, behind), Tracker(), 2.8)
    assert log[0][2] != [None, None]
    assert len(ids_of(log, 0)) == 1
    assert len(ids_of(log, 1)) == 1
    assert ids_of(log, 0) != ids_of(log, 1)
    assert sum(who[0] is None for _, _, who in log) == 0
    assert all(None not in who for _, _, who in log[-12:])
    assert max(len(bodies) for _, bodies, _ in log) == 2
