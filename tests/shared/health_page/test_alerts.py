"""Tests of when alerts are sent, and of their delivery to webhooks and commands."""

from __future__ import annotations

import http.server
import json
import shlex
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from health_server import PATIENCE_S

from enliven.errors import InputError, ResourceError
from enliven.health import Severity
from enliven.health_page import alert_delivery
from enliven.health_page.alert_delivery import (
    AlertSender,
    CommandTarget,
    WebhookTarget,
    alert_targets,
    deliver_once,
)
from enliven.health_page.alerts import ALERT_AFTER_S, RECOVERED_AFTER_S, Alert, AlertRules, make_alert
from enliven.health_page.snapshot import Problem
from enliven.kiosk.profile import AlertSettings

SILENT = Problem("edge silent", "floor", Severity.ERROR, "No heartbeat\x1b.", "Check it.", alerts=True)
SLOW = Problem("low frame rate", "floor", Severity.WARNING, "It is slow.", "USB 3.", alerts=False)
ALERT = make_alert("problem", "lobby", SILENT, 0.0)


def alerts_of(
    desk: AlertRules, problems_at: Callable[[int], list[Problem]], seconds: int
) -> list[tuple[int, Alert]]:
    """Returns the alerts of some seconds, each with its second."""
    return [
        (second, alert)
        for second in range(seconds)
        for alert in desk.update(problems_at(second), float(second), 0.0)
    ]


def test_a_problem_alerts_once_and_its_end_once():
    desk = AlertRules("lobby", 600.0)
    (begin, first), (end, second) = alerts_of(desk, lambda now: [SILENT, SLOW] if now < 1000 else [], 3000)
    assert begin == ALERT_AFTER_S and end == 999 + RECOVERED_AFTER_S
    assert first.event == "problem" and first.kind == "edge silent" and first.severity == "error"
    assert first.message == "No heartbeat\\x1b." and first.at == "1970-01-01T00:00:00+00:00"
    assert second.event == "recovered" and second.subject == "floor"


def test_a_short_problem_is_not_worth_an_alert():
    desk = AlertRules("lobby", 600.0)
    assert alerts_of(desk, lambda now: [SILENT] if now % 60 < ALERT_AFTER_S else [], 600) == []


def test_a_problem_that_comes_and_goes_is_quiet():
    desk = AlertRules("lobby", 600.0)
    alerts = alerts_of(desk, lambda now: [SILENT] if now % 60 < 20 else [], 1200)
    assert [alert.event for _, alert in alerts] == ["problem", "recovered", "problem", "recovered"]
    assert alerts[2][0] - alerts[0][0] >= 600


def test_a_problem_that_stays_is_reported_after_the_quiet_time():
    desk = AlertRules("lobby", 600.0)
    alerts = alerts_of(desk, lambda now: [] if 20 <= now < 60 else [SILENT], 2000)
    assert [alert.event for _, alert in alerts] == ["problem", "recovered", "problem"]
    assert alerts[2][0] == ALERT_AFTER_S + 600


def test_a_short_gap_is_not_an_end():
    desk = AlertRules("lobby", 10.0)
    alerts = alerts_of(desk, lambda now: [] if 50 < now < 60 else [SILENT], 300)
    assert [alert.event for _, alert in alerts] == ["problem"]


def test_ever_new_problems_do_not_fill_the_memory():
    desk = AlertRules("lobby", 600.0)
    many = [Problem(str(number), "", Severity.ERROR, "", "", alerts=True) for number in range(5000)]
    assert desk.update(many, 0.0, 0.0) == []
    assert len(desk.update(many, ALERT_AFTER_S, 0.0)) == 1000


class Receiver(http.server.ThreadingHTTPServer):
    """A web server that stores alerts and answers with the next of its HTTP statuses."""

    def __init__(self) -> None:
        self.alerts, self.statuses, self.arrived = [], [], threading.Semaphore(0)

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(handler) -> None:
                handler.server.alerts.append(
                    json.loads(handler.rfile.read(int(handler.headers["Content-Length"])))
                )
                status = handler.server.statuses.pop(0) if handler.server.statuses else 204
                handler.send_response(status)
                if status == 302:
                    handler.send_header("Location", "http://127.0.0.1:1/")
                handler.end_headers()
                handler.server.arrived.release()

            def log_message(handler, *arguments) -> None:
                pass

        super().__init__(("127.0.0.1", 0), Handler)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/hook/secret"


@pytest.fixture
def receiver(monkeypatch) -> Iterator[Receiver]:
    monkeypatch.setenv("no_proxy", "*")
    with Receiver() as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def test_a_webhook_receives_json(receiver):
    target = WebhookTarget(receiver.url)
    target.deliver(ALERT)
    (alert,) = receiver.alerts
    assert alert["event"] == "problem" and alert["installation"] == "lobby" and alert["remedy"] == "Check it."
    assert "secret" not in target.name


@pytest.mark.parametrize("status", [302, 404, 500])
def test_a_webhook_that_refuses_is_a_failure(receiver, status):
    receiver.statuses = [status]
    with pytest.raises(ResourceError, match=f"status {status}"):
        WebhookTarget(receiver.url).deliver(ALERT)


def test_a_webhook_that_fails_is_tried_again(receiver, monkeypatch):
    monkeypatch.setattr(alert_delivery, "FIRST_RETRY_S", 0.01)
    receiver.statuses = [500, 503]
    courier = AlertSender(WebhookTarget(receiver.url))
    try:
        courier.enqueue_alert(ALERT)
        for _ in range(3):
            assert receiver.arrived.acquire(timeout=PATIENCE_S)
    finally:
        courier.close()
    assert len(receiver.alerts) == 3 and (courier.sent, courier.failures, courier.fault) == (1, 2, "")


def test_an_unreachable_webhook_neither_blocks_nor_ends_the_courier():
    before = set(threading.enumerate())
    courier = AlertSender(WebhookTarget("http://127.0.0.1:1/"))
    (thread,) = set(threading.enumerate()) - before
    for _ in range(1000):
        courier.enqueue_alert(ALERT)
    courier.close()
    assert courier.sent == 0 and not thread.is_alive()


@pytest.mark.parametrize(
    "url", ["ftp://host/", "file:///etc/passwd", "https://", "nothing", "http://a b/", "http://[::1"]
)
def test_a_wrong_address_is_refused(url):
    with pytest.raises(InputError, match=r"alerts\.webhook"):
        alert_targets(AlertSettings(webhook=url))


def python(code: str) -> str:
    return shlex.join([sys.executable, "-c", code])


def test_a_command_receives_json_and_no_shell_runs(tmp_path: Path):
    path = tmp_path / "alert; echo.json"
    code = "import sys; open(sys.argv[1], 'w').write(sys.stdin.read())"
    target = CommandTarget(f"{python(code)} {shlex.quote(str(path))}")
    target.deliver(ALERT)
    assert json.loads(path.read_text())["kind"] == "edge silent"


def test_a_command_need_not_read_its_input():
    CommandTarget(python("pass")).deliver(ALERT)


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (python("raise SystemExit(3)"), "exit code 3"),
        ("/nowhere/alert", "No such file"),
        ("/dev/null", "started"),
    ],
)
def test_a_command_that_fails_is_reported(command, reason):
    assert reason in deliver_once([CommandTarget(command)], ALERT)[0]


def test_a_command_that_hangs_is_killed_with_its_children(monkeypatch):
    monkeypatch.setattr(alert_delivery, "COMMAND_TIMEOUT_S", 0.2)
    code = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'import time; time.sleep(600)'])"
    with pytest.raises(ResourceError, match="was killed"):
        CommandTarget(python(code)).deliver(ALERT)


@pytest.mark.parametrize("command", ["'open", '"'])
def test_a_command_with_wrong_quotes_is_refused(command):
    with pytest.raises(InputError, match=r"alerts\.command"):
        alert_targets(AlertSettings(command=command))
