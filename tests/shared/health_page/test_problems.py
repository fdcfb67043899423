"""Tests of finding problems of an installation: edges, programs, machine and certificate."""

from __future__ import annotations

import pytest
from health_server import FINE
from msgspec.structs import replace

from enliven.health import Severity
from enliven.health_page.problems import (
    find_certificate_problems,
    find_edge_problems,
    find_machine_problems,
    find_program_problems,
    sort_problems,
)
from enliven.health_page.snapshot import (
    CertificateState,
    MachineState,
    MonitoredEdge,
    Problem,
    ProblemKind,
    ProgramState,
)
from enliven.supervision.records import RestartRecord, ServiceRecord
from enliven.wire.streams import HealthMessage

DAY_S = 86_400.0


def edge(**values) -> MonitoredEdge:
    """Returns the state of a healthy edge, with some values changed."""
    usual = {"status": FINE, "heartbeat_age_s": 0.3, "frame_age_s": 0.03, "waiting_s": 0.3, "heard_s": 60.0}
    return MonitoredEdge("floor", "127.0.0.1:5580:5581", **{**usual, **values})


def with_health(kind: str, severity: int) -> MonitoredEdge:
    return edge(
        status=replace(FINE, health=[HealthMessage(kind, severity, 0, "It was unplugged.", "Plug it in.")])
    )


def test_an_edge_that_is_well_has_no_problem():
    assert list(find_edge_problems(edge())) == []


@pytest.mark.parametrize(
    ("state", "kind", "word"),
    [
        (edge(waiting_s=30.0), ProblemKind.EDGE_SILENT, "30 s"),
        (
            edge(waiting_s=30.0, fault="the edge has another key", remedy="Pair."),
            ProblemKind.EDGE_SILENT,
            "another key",
        ),
        (edge(status=None, waiting_s=9.0, frame_age_s=None), ProblemKind.EDGE_SILENT, "127.0.0.1:5580"),
        (edge(frame_age_s=12.0), ProblemKind.NO_FRAMES, "12 s"),
        (edge(frame_age_s=None, heard_s=600.0), ProblemKind.NO_FRAMES, "since its start"),
        (edge(status=replace(FINE, phase="ended")), ProblemKind.NO_FRAMES, "ended"),
        (with_health("sensor lost", 2), ProblemKind.NO_FRAMES, "unplugged"),
        (with_health("floor unknown", 2), "floor unknown", "unplugged"),
        (with_health("sensor hot", 1), "sensor hot", "unplugged"),
    ],
)
def test_problems_of_an_edge_alert_operators(state, kind, word):
    (problem,) = find_edge_problems(state)
    assert problem.kind == kind and problem.alerts and problem.subject == "floor"
    assert word in problem.message and problem.remedy


def test_an_edge_may_start_slowly():
    assert list(find_edge_problems(edge(status=None, waiting_s=2.0, frame_age_s=None))) == []
    assert list(find_edge_problems(edge(frame_age_s=None, heard_s=100.0))) == []


def test_missing_frames_are_reported_once():
    state = edge(
        frame_age_s=60.0,
        status=replace(
            FINE, health=[HealthMessage("no frames", 2, 0, "No frames arrive.", "Check the cable.")]
        ),
    )
    assert [problem.message for problem in find_edge_problems(state)] == ["No frames arrive."]


def test_a_note_and_a_warning_do_not_alert():
    for kind, severity in (("learning the room", 0), ("low frame rate", 1)):
        (problem,) = find_edge_problems(with_health(kind, severity))
        assert not problem.alerts and problem.severity is Severity(severity)


def test_programs_that_ended_or_froze_are_found():
    window = ServiceRecord("window", 7, 0.0, 1000.0)
    running, ended = ProgramState(window, True), ProgramState(window, False)
    assert list(find_program_problems([running], [], 1020.0, 10.0)) == []
    (frozen,) = find_program_problems([running], [], 1200.0, 10.0)
    (gone,) = find_program_problems([ended], [], 1000.0, 10.0)
    assert frozen.kind == ProblemKind.PROGRAM_FROZEN and "3 min" in frozen.message
    assert gone.kind == ProblemKind.PROGRAM_ENDED and "7" in gone.message


def test_a_program_that_starts_is_not_frozen():
    starting = ProgramState(ServiceRecord("edge", 7, 1000.0), True)
    assert list(find_program_problems([starting], [], 1100.0, 10.0)) == []


def test_a_restart_is_a_problem_for_ten_minutes():
    restarts = [RestartRecord("window", 900.0, "it froze"), RestartRecord("window", 1000.0, "it\x1bcrashed")]
    (problem,) = find_program_problems([], restarts, 1100.0, 10.0)
    assert problem.kind == ProblemKind.PROGRAM_RESTARTED and "it\\x1bcrashed" in problem.message
    assert list(find_program_problems([], restarts, 1700.0, 10.0)) == []
    assert list(find_program_problems([], restarts, 500.0, 10.0)) == []  # the clock was set back


def test_a_full_disk_and_heat_are_found():
    machine = MachineState(temperature_c=91.0, disk_folder="/recordings", disk_free_bytes=0.4e9)
    disk, hot = find_machine_problems(machine, 1.0)
    assert "0.40 GB" in disk.message and disk.subject == "/recordings" and "91 °C" in hot.message
    assert list(find_machine_problems(MachineState(disk_free_bytes=1.1e9, temperature_c=60.0), 1.0)) == []
    assert list(find_machine_problems(MachineState(), 1.0)) == []


@pytest.mark.parametrize("use", ["health", "souvenirs"])
def test_a_certificate_is_reported_14_days_before_its_end(use):
    end_s = 100 * DAY_S
    certificate = CertificateState(use, "cert.pem", end_s)
    assert list(find_certificate_problems(certificate, end_s - 15 * DAY_S)) == []
    (soon,) = find_certificate_problems(certificate, end_s - 13 * DAY_S)
    (late,) = find_certificate_problems(certificate, end_s)
    assert f"{use} server expires on 1970-04-11" in soon.message and soon.severity is Severity.WARNING
    assert f"{use} server expired on 1970-04-11" in late.message and late.severity is Severity.ERROR
    assert soon.alerts and late.alerts and soon.kind != late.kind, "the second one must alert again"


def test_an_unreadable_certificate_is_a_warning():
    (problem,) = find_certificate_problems(CertificateState("souvenirs", "cert.pem", None, "it is gone"), 0.0)
    assert problem.kind == ProblemKind.CERTIFICATE_UNREADABLE and "it is gone" in problem.message
    assert problem.alerts and problem.severity is Severity.WARNING


def test_the_most_severe_problem_comes_first():
    problems = [Problem("b", "", Severity.WARNING, "", ""), Problem("a", "z", Severity.ERROR, "", "")]
    assert [problem.kind for problem in sort_problems(problems)] == ["a", "b"]
