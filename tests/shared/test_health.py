"""Tests of health states: their order, and their encoding on the wire."""

from hypothesis import given
from hypothesis import strategies as st

from enliven.health import HealthKind, HealthState, Severity, sort_by_severity
from enliven.logs import escape_text
from enliven.wire.convert import health_to_messages, messages_to_health
from enliven.wire.envelope import pack_stream, unpack_stream
from enliven.wire.fields import MAX_HEALTH
from enliven.wire.streams import HealthMessage, StatusMessage
from enliven.wire.topics import STATUS

states = st.builds(
    HealthState,
    st.sampled_from([str(k) for k in HealthKind]),
    st.sampled_from(Severity),
    st.integers(0, 10**15),
    st.text(max_size=40).map(escape_text),
    st.text(max_size=40).map(escape_text),
    st.integers(-1, 9),
)


@given(st.lists(states, max_size=MAX_HEALTH))
def test_states_survive_the_wire(given_states):
    status = StatusMessage("edge", 1, 2, 3, health=health_to_messages(given_states))
    back = unpack_stream(pack_stream(status))[1]
    assert messages_to_health(back.health) == sort_by_severity(given_states)


def test_the_gravest_go_first_and_a_heartbeat_stays_small():
    many = [HealthState(HealthKind.UNCLEAR, Severity(i % 3), i, "w" * 1000, "ü" * 1000, i) for i in range(40)]
    messages = health_to_messages(many)
    assert len(messages) == MAX_HEALTH
    assert [m.severity for m in messages] == [2] * MAX_HEALTH
    assert [m.since_ns for m in messages] == sorted(m.since_ns for m in messages)
    status = StatusMessage("e" * 64, 2**53, 2**53, 2**62, "s" * 200, "p" * 64, "n" * 400, health=messages)
    assert len(pack_stream(status)) <= STATUS.max_bytes


def test_a_kind_of_a_later_program_is_read():
    later = HealthMessage("too much applause", 1, 5, "They clap.", "Bow.", 2)
    (state,) = messages_to_health([later])
    assert (state.kind, state.severity, state.performer) == ("too much applause", Severity.WARNING, 2)
    assert "They clap. Bow." in str(state)
