"""Tests of clock alignment in simulated networks: delays, drift, loss, and clocks that are set."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from enliven.peers.clock_sync import (
    BURST_INTERVAL_S,
    MAX_SLEW,
    PROBE_INTERVAL_S,
    PROBES_PER_BURST,
    ClockExchange,
    ClockSync,
)

SECOND = 1_000_000_000
MS = 1_000_000
STEP = 4 * MS
QUICK = settings(max_examples=30, deadline=None, phases=(Phase.explicit, Phase.generate))


@dataclass
class Network:
    """A simulated edge. Its clock drifts and may be set, and each direction has a random delay.

    Attributes:
        offset: edge time minus local time at local time 0, nanoseconds.
        drift: seconds per second.
        delay: mean random delay of each direction, nanoseconds, in addition to 0.1 ms.
        answer: mean time until the edge answers, nanoseconds.
        loss: fraction of the probes without an answer.
    """

    offset: int = 0
    drift: float = 0.0
    delay: float = MS
    answer: float = 10 * MS
    loss: float = 0.0
    seed: int = 0
    rng: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)

    def edge_ns(self, local_ns: int) -> int:
        return local_ns + self.true_offset(local_ns)

    def true_offset(self, local_ns: int) -> int:
        return self.offset + round(self.drift * local_ns)

    def probe(self, sent_ns: int) -> ClockExchange | None:
        if self.rng.uniform() < self.loss:
            return None
        there, back = (0.1 * MS + self.rng.exponential(self.delay) for _ in range(2))
        arrived = sent_ns + round(there)
        answered = arrived + round(self.rng.exponential(self.answer))
        return ClockExchange(sent_ns, self.edge_ns(arrived), self.edge_ns(answered), answered + round(back))


def run(sync: ClockSync, network: Network, start_ns: int, seconds: float) -> list[tuple[int, int]]:
    """Simulates both sides. Returns (local time, offset) of each step."""
    waiting: list[ClockExchange] = []
    offsets = []
    for now in range(start_ns, start_ns + round(seconds * SECOND), STEP):
        if sync.take_due_probe(now) and (exchange := network.probe(now)) is not None:
            waiting.append(exchange)
        for exchange in sorted((e for e in waiting if e.received_ns <= now), key=lambda e: e.received_ns):
            waiting.remove(exchange)
            sync.add(exchange)
        if sync.is_known:
            offsets.append((now, sync.offset_ns(now)))
    return offsets


def test_burst_of_eight_probes_starts_every_two_seconds() -> None:
    sync, network = ClockSync(), Network()
    sent = []
    for now in range(0, 10 * SECOND, MS):
        if sync.take_due_probe(now):
            sent.append(now)
            exchange = network.probe(now)
            assert exchange is not None
            sync.add(exchange)
    assert len(sent) == 5 * PROBES_PER_BURST
    gaps = np.diff(sent) / SECOND
    inside = gaps[np.arange(len(gaps)) % PROBES_PER_BURST != PROBES_PER_BURST - 1]
    assert np.allclose(inside, PROBE_INTERVAL_S, atol=2e-3)
    assert np.allclose(np.diff(sent[::PROBES_PER_BURST]) / SECOND, BURST_INTERVAL_S, atol=2e-3)


@QUICK
@given(
    offset=st.integers(-(10**18), 10**18),
    drift=st.floats(-1e-4, 1e-4),
    delay_ms=st.floats(0.0, 5.0),
    answer_ms=st.floats(0.0, 40.0),
    loss=st.floats(0.0, 0.1),
    seed=st.integers(0, 2**31),
)
def test_offset_stays_within_half_a_round_trip_and_time_never_goes_back(
    offset: int, drift: float, delay_ms: float, answer_ms: float, loss: float, seed: int
) -> None:
    network = Network(offset, drift, delay_ms * MS, answer_ms * MS, loss, seed)
    sync = ClockSync()
    offsets = run(sync, network, 0, 20.0)
    if not offsets:
        return  # Every burst lost three answers.
    edge_times = [now + estimate for now, estimate in offsets]
    assert all(b > a for a, b in pairwise(edge_times))
    steps = np.diff([estimate for _, estimate in offsets])
    assert np.abs(steps).max() <= MAX_SLEW * 2 * STEP + 2
    # A burst is wrong by half of its shortest round trip at most. The clocks drift apart until the next.
    worst_ns = max(abs(estimate - network.true_offset(now)) for now, estimate in offsets)
    longest_ns = 2 * (0.1 * MS + 12 * delay_ms * MS)
    assert worst_ns <= longest_ns / 2 + 10.0 * abs(drift) * SECOND + 0.1 * MS


@QUICK
@given(
    seed=st.integers(0, 2**31),
    jump=st.sampled_from([-3600, -30, -1, 1, 30, 3600, 86400 * 365]),
)
def test_a_clock_that_is_set_is_followed_within_two_bursts(seed: int, jump: int) -> None:
    network, sync = Network(7 * SECOND, seed=seed), ClockSync()
    run(sync, network, 0, 10.3)
    network.offset += jump * SECOND
    start = 10_300 * MS
    offsets = run(sync, network, start, 2 * BURST_INTERVAL_S + 1.0)
    assert abs(offsets[-1][1] - network.true_offset(offsets[-1][0])) < 5 * MS
    settled = [abs(estimate - network.true_offset(now)) for now, estimate in offsets[-100:]]
    assert max(settled) < 5 * MS


def test_too_few_answers_change_nothing() -> None:
    sync, network = ClockSync(), Network(5 * SECOND, delay=0.0)
    run(sync, network, 0, 4.0)
    before = sync.offset_ns(4 * SECOND)
    network.loss, network.offset = 1.0, 50 * SECOND
    run(sync, network, 4 * SECOND, 10.0)
    assert sync.offset_ns(14 * SECOND) == before
    assert sync.failed_bursts >= 4


def test_impossible_answers_are_dropped() -> None:
    sync = ClockSync()
    assert sync.take_due_probe(0)
    for _ in range(20):
        sync.add(ClockExchange(0, 100, 50, 1000))  # answered before it arrived
        sync.add(ClockExchange(10, 0, 5000, 20))  # the edge needed longer than the whole exchange
        sync.add(ClockExchange(-5, 0, 0, 10))  # sent before the burst
    assert not sync.is_known


def test_long_round_trips_move_the_offset_less() -> None:
    sync = ClockSync()

    def burst(start: int, round_trip: int, offset: int) -> None:
        for k in range(PROBES_PER_BURST):
            now = start + k * round(PROBE_INTERVAL_S * SECOND)
            assert sync.take_due_probe(now)
            middle = now + round_trip // 2 + offset
            sync.add(ClockExchange(now, middle, middle, now + round_trip))

    burst(0, MS // 10, 0)
    burst(2 * SECOND, 40 * MS, 8 * MS)
    assert abs(sync.offset_ns(60 * SECOND)) < MS // 10
