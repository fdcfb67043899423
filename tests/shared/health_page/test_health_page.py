"""Tests of the health page with real edges' heartbeats and records, served by the real server on loopback."""

from __future__ import annotations

import datetime
import json
import os
import re
import shlex
import signal
import ssl
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import pytest
from health_server import BODIES, FINE, HeartbeatEdge, health_page, profile_of
from msgspec.structs import replace as change
from PIL import Image
from prometheus_client.parser import text_string_to_metric_families

from enliven import cli
from enliven.commands import doctor
from enliven.errors import InputError, ResourceError
from enliven.health_page import app
from enliven.health_page.metrics import METRICS
from enliven.health_page.server import send_test_alert, serve_health
from enliven.kiosk.profile import (
    AlertSettings,
    CareSettings,
    HealthPageSettings,
    KioskEdge,
    KioskProfile,
    SouvenirSettings,
)
from enliven.supervision.records import (
    RestartRecord,
    ServiceRecord,
    append_restart,
    read_services,
    runtime_folder,
    write_service,
)
from enliven.wire import free_ports, pack_stream
from enliven.wire.streams import HealthMessage

PASSWORD = "correct horse"
WINDOW = ServiceRecord("window", os.getpid(), time.time() - 60.0, time.time(), "attract", {"fps": 60.0})
LACKING = 4
UNUSABLE = 3
HOSTILE = "<script>alert(1)</script>\"&'\u202e\x1b"
"""A name that an attacker could give to an edge."""


@contextmanager
def edges(**messages: tuple[bytes, ...]) -> Iterator[dict[str, HeartbeatEdge]]:
    """Runs edges that publish messages."""
    running = {name: HeartbeatEdge(*sent) for name, sent in messages.items()}
    try:
        yield running
    finally:
        for edge in running.values():
            edge.close()


@contextmanager
def other_program(*words: str) -> Iterator[int]:
    """Runs a process that waits. Yields its id, and ends it."""
    code = "import time; time.sleep(600)"
    process = subprocess.Popen([sys.executable, "-c", code, *words])
    try:
        yield process.pid
    finally:
        process.kill()
        process.wait()


def form_of(page, action: str, subject: str) -> tuple[int, str]:
    """Returns the HTTP status of the page that asks for confirmation, and the body of its form."""
    from urllib.parse import quote, urlencode

    status, _, body = page.request("GET", f"/confirm?action={action}&subject={quote(subject)}")
    fields = dict(re.findall(r'name="(subject|token)" value="([^"]*)"', body.decode()))
    return status, urlencode({**fields, "subject": subject})


def test_page_report_and_metrics_show_the_same_state():
    write_service(
        ServiceRecord("window", os.getpid(), time.time() - 60.0, time.time(), "attract", {"fps": 60.0})
    )
    with (
        edges(floor=(BODIES, pack_stream(FINE))) as running,
        health_page(profile_of(running)) as page,
    ):
        text = page.wait_for("30 frames/s, 1 person")
        assert "No problems" in text and "camera 1" in text and "attract" in text and "21.0 ms" in text
        status, headers, body = page.request("GET", "/health")
        report = json.loads(body)
        metrics = {
            sample.name: sample
            for family in text_string_to_metric_families(page.get("/metrics"))
            for sample in family.samples
        }
    assert status == 200 and headers["content-type"] == "application/json" and report["status"] == "ok"
    assert report["edges"][0]["fps"] == pytest.approx(29.7) and report["programs"][0]["name"] in (
        "health",
        "window",
    )
    assert metrics["enliven_edge_up"].labels == {"edge": "floor"} and metrics["enliven_edge_up"].value == 1.0
    assert metrics["enliven_edge_latency_seconds"].value == pytest.approx(0.021)
    assert metrics["enliven_edge_people"].value == 1.0 and metrics["enliven_disk_free_bytes"].value > 0.0


def test_every_metric_of_the_output_is_in_the_table():
    append_restart(RestartRecord("window", time.time(), "it froze"))
    hot = ServiceRecord("edge floor", os.getpid(), time.time(), time.time(), "", {"temperature_c": 50.0})
    write_service(hot)
    with (
        edges(floor=(BODIES, pack_stream(FINE))) as running,
        health_page(profile_of(running)) as page,
    ):
        page.wait_for("enliven_edge_frame_age_seconds{", "/metrics")
        families = list(text_string_to_metric_families(page.get("/metrics")))
    table = {metric.name: metric for metric in METRICS}
    for family in families:
        for sample in family.samples:
            assert set(sample.labels) == set(table[sample.name].labels), sample
    always = {"enliven_edge_temperature_celsius", "enliven_edge_up", "enliven_program_up", "enliven_problem"}
    assert always <= {sample.name for family in families for sample in family.samples}


def test_headers_forbid_everything_from_elsewhere():
    with edges(floor=(pack_stream(FINE),)) as running, health_page(profile_of(running)) as page:
        for path in ("/", "/health", "/metrics", "/static/health.css", "/nothing"):
            _, headers, _ = page.request("GET", path)
            policy = headers["content-security-policy"]
            assert (
                "default-src 'none'" in policy
                and "'unsafe" not in policy
                and "frame-ancestors 'none'" in policy
            )
            assert headers["x-content-type-options"] == "nosniff" and "server" not in headers
        text = page.get("/")
        assert not re.search(r"https?://", text) and " style=" not in text and "<noscript>" in text
        for path in re.findall(r'(?:href|src)="(/static/[^"]*)"', text):
            assert page.request("GET", path)[0] == 200
        assert page.request("GET", "/static/../app.py")[0] == 404
        assert page.request("POST", "/")[0] == 405


def test_hostile_names_are_escaped():
    health = [HealthMessage(HOSTILE[:20], 2, 0, HOSTILE, HOSTILE)]
    status = change(FINE, edge=HOSTILE, sensor=HOSTILE, phase=HOSTILE, note=HOSTILE, health=health)
    write_service(ServiceRecord(HOSTILE, os.getpid(), 0.0, 0.0, HOSTILE, {HOSTILE: 1.0}))
    append_restart(RestartRecord(HOSTILE, time.time(), HOSTILE))
    with (
        edges(floor=(BODIES, pack_stream(status))) as running,
        health_page(profile_of({HOSTILE: running["floor"]}, HOSTILE)) as page,
    ):
        text = page.wait_for("1 person")
        metrics = page.get("/metrics")
    assert "<script>alert" not in text and "&lt;script&gt;alert(1)" in text
    assert list(text_string_to_metric_families(metrics))


def test_a_foreign_name_of_this_computer_is_refused():
    with edges(floor=(pack_stream(FINE),)) as running, health_page(profile_of(running)) as page:
        for host in ("evil.example", f"evil.example:{page.port}", ""):
            assert page.request("GET", "/", {"Host": host})[0] == 400
        for host in (f"127.0.0.1:{page.port}", f"localhost:{page.port}", f"[::1]:{page.port}"):
            assert page.request("GET", "/health", {"Host": host})[0] in (200, 503), host


def test_a_silent_edge_is_an_error_and_then_recovers(tmp_path, monkeypatch):
    monkeypatch.setattr("enliven.health_page.problems.EDGE_SILENT_AFTER_S", 0.5)
    monkeypatch.setattr("enliven.health_page.snapshot.EDGE_SILENT_AFTER_S", 0.5)
    monkeypatch.setattr("enliven.health_page.alerts.RECOVERED_AFTER_S", 0.5)
    monkeypatch.setattr("enliven.health_page.alerts.ALERT_AFTER_S", 0.5)
    path = tmp_path / "alerts"
    code = f"import sys; open({str(path)!r}, 'a').write(sys.stdin.read())"
    command = f'"{sys.executable}" -c "{code}"'
    with edges(floor=()) as running:
        profile = replace(profile_of(running), alerts=AlertSettings(command=command))
        with health_page(profile) as page:
            page.wait_for("edge silent")
            assert page.request("GET", "/health")[0] == 503
            page.wait_for("enliven_alerts_sent_total 1", "/metrics")
            running["floor"].messages = (BODIES, pack_stream(FINE))
            page.wait_for("No problems")
            page.wait_for("enliven_alerts_sent_total 2", "/metrics")
            assert page.request("GET", "/health")[0] == 200
    events = [json.loads(line) for line in path.read_text().splitlines()]
    assert [(event["event"], event["kind"]) for event in events] == [
        ("problem", "edge silent"),
        ("recovered", "edge silent"),
    ]


def test_an_edge_of_another_version_is_explained(monkeypatch):
    monkeypatch.setattr("enliven.health_page.problems.EDGE_SILENT_AFTER_S", 0.5)
    other = bytearray(pack_stream(FINE))
    other[len("status") + 1] += 1
    damaged = b"status\0" + bytes([other[len("status") + 1] - 1]) + b"\xc1"
    with edges(floor=(bytes(other),), roof=(damaged,)) as running, health_page(profile_of(running)) as page:
        text = page.wait_for("version")
        assert "Install the same version" in text
        page.wait_for("heartbeat of the edge is damaged")


def test_a_hundred_edges_are_shown():
    with edges(floor=(BODIES, pack_stream(FINE))) as running:
        address = running["floor"].address
        names = {f"edge {number:03d}": KioskEdge(address=address) for number in range(100)}
        with health_page(KioskProfile(edges=names)) as page:
            page.wait_for("No problems")
            text = page.wait_for("edge 099")
            metrics = page.wait_for('enliven_edge_people{edge="edge 099"}', "/metrics")
    assert text.count("<details") == 100 and "92 more edges" in text
    assert metrics.count("enliven_edge_up{") == 100


def test_restarts_and_ended_programs_are_shown():
    append_restart(RestartRecord("window", time.time() - 60.0, "it made no progress for 10 s"))
    append_restart(RestartRecord("window", time.time() - 90_000.0, "it is too old to be shown"))
    write_service(ServiceRecord("window", 2**22 + 1, time.time() - 60.0, time.time()))
    with edges(floor=(BODIES, pack_stream(FINE))) as running, health_page(profile_of(running)) as page:
        text = page.wait_for("program restarted")
    assert "it made no progress for 10 s" in text and "too old" not in text and "program ended" in text


def test_a_restart_needs_the_form_and_ends_only_programs_of_enliven(monkeypatch):
    with (
        edges(floor=(pack_stream(FINE),)) as running,
        other_program("enliven", "window") as pid,
        other_program("something else") as foreign,
    ):
        write_service(ServiceRecord("window", pid, time.time(), time.time()))
        write_service(ServiceRecord("foreign", foreign, time.time(), time.time()))
        with health_page(profile_of(running)) as page:
            page.wait_for("foreign")
            status, form = form_of(page, "restart", "window")
            assert status == 200 and "token=" in form
            interval_s = 0.5
            monkeypatch.setattr(app, "_MIN_ACTION_INTERVAL_S", interval_s)
            assert page.request("POST", "/restart", body="subject=window&token=wrong")[0] == 409
            assert page.request("POST", "/restart", body=form.replace("window", "foreign"))[0] == 409
            assert page.request("POST", "/restart", {"Origin": "http://evil.example"}, form)[0] == 409
            assert page.request("POST", "/restart", body=form + "&x=" + "y" * 10_000)[0] == 409
            assert page.request("GET", "/restart")[0] == 405
            assert alive(pid)
            status, headers, _ = page.request("POST", "/restart", body=form)
            assert status == 303 and headers["location"] == "/"
            assert "127.0.0.1 restarted the program" in page.get("/")
            assert ended_by(pid) == signal.SIGTERM
            assert "a moment ago" in page.request("POST", "/restart", body=form)[2].decode()
            time.sleep(interval_s)
            status, _, body = page.request("POST", "/restart", body=form_of(page, "restart", "foreign")[1])
            assert status == 409 and b"not a program of enliven" in body and alive(foreign)


def alive(pid: int) -> bool:
    with suppress(ChildProcessError):
        return os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None
    return False


def ended_by(pid: int) -> int:
    """Returns the signal that ended a child process."""
    return os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT).si_status


@pytest.mark.parametrize(
    "query",
    [
        "",
        "?action=restart&subject=nothing",
        "?action=code&subject=%3Cscript%3E",
        "?action=stop&subject=floor",
    ],
)
def test_unknown_actions_are_not_offered(query):
    with edges(floor=(pack_stream(FINE),)) as running, health_page(profile_of(running)) as page:
        status, _, body = page.request("GET", f"/confirm{query}")
    assert status == 404 and b"<form" not in body and b"<script>" not in body


def test_the_picture_of_the_screen_is_served():
    with edges(floor=(pack_stream(FINE),)) as running, health_page(profile_of(running)) as page:
        assert page.request("GET", "/screen.png")[0] == 404
        assert "has stored a picture" in page.get("/")
        Image.new("RGB", (64, 36), "purple").save(runtime_folder() / "screen.png")
        status, headers, body = page.request("GET", "/screen.png")
        assert status == 200 and headers["content-type"] == "image/png" and body.startswith(b"\x89PNG")
        assert 'src="/screen.png?' in page.get("/")
        (runtime_folder() / "screen.png").write_bytes(b"<html>")
        assert page.request("GET", "/screen.png")[0] == 404


def test_damaged_records_and_a_missing_folder_do_not_end_the_page(tmp_path, monkeypatch):
    write_service(ServiceRecord("window", os.getpid(), 0.0, 0.0))
    services = runtime_folder() / "services"
    (services / "cut.json").write_bytes(b'{"name": "ed')
    strange = '{"name": "s", "pid": -5, "started_s": 1e300, "progress_s": 1e300}'
    (services / "strange.json").write_text(strange)
    (tmp_path / "state" / "enliven").mkdir(parents=True)
    (tmp_path / "state" / "enliven" / "restarts.jsonl").write_bytes(b'\xff\xfe{"name"\n[]\n')
    with edges(floor=(BODIES, pack_stream(FINE))) as running, health_page(profile_of(running)) as page:
        page.wait_for("program ended")
        blocked = tmp_path / "file"
        blocked.write_text("")
        monkeypatch.setenv("ENLIVEN_RUNTIME", str(blocked / "runtime"))
        page.wait_for("records of the programs cannot be read")
        assert page.request("GET", "/metrics")[0] == 200


def test_a_full_disk_is_a_warning_and_not_an_error():
    with edges(floor=(BODIES, pack_stream(FINE))) as running:
        profile = replace(profile_of(running), care=CareSettings(keep_free=9999.0))
        with health_page(profile) as page:
            page.wait_for("disk almost full")
            assert page.request("GET", "/health")[0] == 200
            assert 'enliven_problem{kind="disk almost full"' in page.get("/metrics")


def test_the_program_writes_its_own_record_and_its_history(tmp_path):
    with edges(floor=(BODIES, pack_stream(FINE))) as running, health_page(profile_of(running)) as page:
        page.wait_for("30 frames/s")
        page.wait_for('id="health"')
        page.wait_for("reports: ok")
        assert [record.pid for record in read_services() if record.name == "health"] == [os.getpid()]
    assert (tmp_path / "state" / "enliven" / "health-history.msgpack").stat().st_size > 1000


def test_log_files_are_shown_without_markup(tmp_path):
    folder = tmp_path / "state" / "enliven" / "logs"
    folder.mkdir(parents=True)
    (folder / "window.log").write_text("x" * 200_000 + "\n" + "<b>last words</b>\x1b[2J\n")
    with edges(floor=(pack_stream(FINE),)) as running, health_page(profile_of(running)) as page:
        text = page.get("/")
    if "No log was found" not in text and "last words" not in text:
        pytest.skip("the journal of this computer has lines of enliven")
    assert "window: &lt;b&gt;last words&lt;/b&gt;\\x1b[2J" in text


@contextmanager
def secured(tmp_path: Path, certificates, running) -> Iterator[tuple[KioskProfile, ssl.SSLContext, Path]]:
    """Yields a profile with a password and TLS, and the context that trusts it."""
    path, key = certificates.make("server", days=10.0)
    password = tmp_path / "password"
    password.write_text(PASSWORD)
    password.chmod(stat.S_IRUSR | stat.S_IWUSR)
    settings = HealthPageSettings(
        host="0.0.0.0", password_file=str(password), certificate=str(path), certificate_key=str(key)
    )
    yield (
        replace(profile_of(running), health=settings),
        ssl.create_default_context(cafile=path),
        path,
    )


def test_beyond_loopback_only_the_password_over_tls_opens_the_page(
    tmp_path, certificates, monkeypatch, capsys
):
    with (
        edges(floor=(BODIES, pack_stream(FINE))) as running,
        secured(tmp_path, certificates, running) as (profile, context, certificate),
        health_page(profile, PASSWORD, context) as page,
    ):
        text = page.wait_for("TLS certificate of the health server expires")
        assert "30 frames/s" in text
        _, headers, _ = page.request("GET", "/")
        assert "strict-transport-security" in headers
        for path in ("/", "/health", "/metrics", "/screen.png", "/static/health.css"):
            status, headers, _ = page.request("GET", path, {"Authorization": ""})
            assert status == 401 and headers["www-authenticate"].startswith("Basic")
        url = f"https://localhost:{page.port}"
        assert check_installation(url, certificate, PASSWORD, monkeypatch, capsys)[0] == LACKING
        code, checks = check_installation(url, certificate, PASSWORD, monkeypatch, capsys)
        assert not checks[f"{certificate}: certificate expires"]["ok"] and checks["edge floor"]["ok"]
        assert code == LACKING
        assert check_installation(url, None, PASSWORD, monkeypatch, capsys)[1]["health page"]["mend"]
        assert cli.run(["doctor", "--remote", url, "--certificate", str(certificate)]) == UNUSABLE
        for _ in range(10):
            page.request("GET", "/", {"Authorization": "Basic b3A6d3Jvbmc="})
        status, headers, _ = page.request("GET", "/")
        assert status == 429 and int(headers["retry-after"]) > 0
        assert cli.run(["doctor", "--remote", url, "--certificate", str(certificate)]) == UNUSABLE
        assert "too many wrong passwords" in capsys.readouterr().err


def test_the_certificate_of_souvenirs_warns_on_the_page_to_the_doctor_and_by_an_alert(
    tmp_path, certificates, monkeypatch, capsys
):
    monkeypatch.setattr("enliven.health_page.alerts.ALERT_AFTER_S", 0.5)
    code = f"import sys; open({str(tmp_path / 'alerts')!r}, 'a').write(sys.stdin.read())"
    alerts = AlertSettings(command=shlex.join([sys.executable, "-c", code]))
    path, key = certificates.make("souvenirs", days=10.0)
    souvenir = SouvenirSettings("photo", certificate=str(path), certificate_key=str(key))
    long_ago = datetime.datetime.now(datetime.UTC) - datetime.timedelta(days=9.0)
    with edges(floor=(BODIES, pack_stream(FINE))) as running:
        profile = replace(profile_of(running), souvenir=souvenir, alerts=alerts)
        with health_page(profile) as page:
            page.wait_for("TLS certificate of the souvenirs server expires")
            page.wait_for("enliven_alerts_sent_total 1", "/metrics")
            assert 'enliven_certificate_expiry_time_seconds{use="souvenirs"}' in page.get("/metrics")
            assert page.request("GET", "/health")[0] == 200
            url = f"http://127.0.0.1:{page.port}"
            exit_code, checks = check_installation(url, None, "", monkeypatch, capsys)
            assert exit_code == LACKING and not checks[f"{path}: certificate expires"]["ok"]
            certificates.make("souvenirs", begin=long_ago, days=8.0)
            page.wait_for("TLS certificate of the souvenirs server expired")
            page.wait_for("enliven_alerts_sent_total 2", "/metrics")
            assert page.request("GET", "/health")[0] == 503
            certificates.make("souvenirs", days=100.0)
            page.wait_for("No problems")
            path.unlink()
            page.wait_for("TLS certificate of the souvenirs server cannot be read")
    kinds = [json.loads(line)["kind"] for line in (tmp_path / "alerts").read_text().splitlines()]
    assert kinds[:2] == ["certificate expires", "certificate expired"]


def check_installation(url, certificate, password, monkeypatch, capsys) -> tuple[int, dict[str, dict]]:
    """Returns the exit code of the doctor, and its checks by name."""
    with monkeypatch.context() as patch:
        patch.setenv("ENLIVEN_HEALTH_PASSWORD", password)
        trusted = [] if certificate is None else ["--certificate", str(certificate)]
        code = cli.run(["doctor", "--remote", url, "--json", *trusted])
    return code, {check["name"]: check for check in json.loads(capsys.readouterr().out)}


def test_the_doctor_reads_a_page_of_this_computer(monkeypatch, capsys):
    with edges(floor=(BODIES, pack_stream(FINE))) as running, health_page(profile_of(running)) as page:
        page.wait_for("30 frames/s")
        page.wait_for("reports: ok")
        code, checks = check_installation(f"http://127.0.0.1:{page.port}", None, "", monkeypatch, capsys)
    assert code == 0 and checks["edge floor"]["detail"] == "tracking, 1 performer, 30 poses per second"
    assert checks["health page"]["detail"].startswith("lobby") and checks["health page"]["detail"].endswith(
        ": ok"
    )


def test_the_doctor_refuses_wrong_addresses_and_foreign_answers(capsys, monkeypatch):
    monkeypatch.setenv("ENLIVEN_HEALTH_PASSWORD", PASSWORD)
    for url in ("ftp://host", "https://", "http://host/path", "http://[::1"):
        assert cli.run(["doctor", "--remote", url]) == UNUSABLE
    assert cli.run(["doctor", "--remote", "http://192.0.2.1:5590"]) == UNUSABLE
    assert "without encryption" in capsys.readouterr().err
    code, checks = check_installation(f"http://127.0.0.1:{free_ports(1)[0]}", None, "", monkeypatch, capsys)
    assert code == LACKING and "enliven health" in checks["health page"]["mend"]
    assert doctor.MAX_HEARTBEAT_WAIT_S > 0.0


def test_mistakes_are_reported_at_the_start(tmp_path):
    port = free_ports(1)[0]
    profile = KioskProfile(health=HealthPageSettings(port=port))
    with pytest.raises(InputError, match=r"alerts\.webhook"):
        serve_health(replace(profile, alerts=AlertSettings(webhook="gopher://x")))
    with pytest.raises(InputError, match="address"):
        serve_health(replace(profile, edges={"floor": KioskEdge(address="a b")}))
    with pytest.raises(InputError, match="to serve other computers"):
        serve_health(replace(profile, health=HealthPageSettings(host="0.0.0.0")))
    with health_page(profile) as page, pytest.raises(ResourceError, match=str(page.port)):
        serve_health(replace(profile, health=HealthPageSettings(port=page.port)))


def test_a_test_alert_reaches_the_command(tmp_path):
    path = tmp_path / "alert"
    code = f"import sys; open({str(path)!r}, 'w').write(sys.stdin.read())"
    command = f'"{sys.executable}" -c "{code}"'
    profile = KioskProfile(name="lobby", alerts=AlertSettings(command=command))
    assert send_test_alert(profile) == [f"command {sys.executable}"]
    assert json.loads(path.read_text())["event"] == "test"
    with pytest.raises(InputError, match="no receiver"):
        send_test_alert(KioskProfile())
    with pytest.raises(ResourceError, match="exit code 1"):
        send_test_alert(replace(profile, alerts=AlertSettings(command="false")))
