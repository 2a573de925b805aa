"""``r6.Gateway`` against a gateway of this repository. ``test_gateway_peers.py`` has peers that misbehave."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any, Literal

import pytest
from halls import Hall, r6_program, whole_request

import r6


@pytest.fixture(scope="module")
def program() -> Path:
    return r6_program()


@pytest.fixture(scope="module")
def controller() -> Iterator[r6.Simulator]:
    with r6.Simulator() as controller:
        yield controller


@pytest.fixture(scope="module")
def hall(program: Path, tmp_path_factory: pytest.TempPathFactory, controller: r6.Simulator) -> Iterator[Hall]:
    hall = Hall(program, tmp_path_factory.mktemp("hall") / "data", controller)
    yield hall
    hall.close()


@pytest.fixture(scope="module")
def operator(hall: Hall) -> r6.Gateway:
    """A client that may command, and the robot answers."""
    gateway = r6.Gateway(hall.url, token=hall.token("--role", "operator"))
    end = monotonic() + 30
    while not gateway.robot("arm").state().is_up:
        assert monotonic() < end, gateway.robots()
        sleep(0.02)
    return gateway


def test_a_gateway_with_tls_is_asked_only_if_its_certificate_is_trusted(
    program: Path, tmp_path: Path, controller: r6.Simulator
) -> None:
    hall = Hall(program, tmp_path / "data", controller, "--tls")
    try:
        token = hall.token("--role", "viewer")
        trusted = r6.Gateway(hall.url, token=token, ca_file=tmp_path / "data" / "tls" / "certificate.pem")
        assert [robot.name for robot in trusted.robots()] == ["arm"]
        assert next(trusted.live()).kind == "snapshot"
        with pytest.raises(r6.NotSent, match="is not trusted.*ca_file") as untrusted:
            r6.Gateway(hall.url, token=token).robots()
        assert untrusted.value.reason == "unreachable"
        with pytest.raises(r6.R6Error, match="begin the URL with https"):
            r6.Gateway(hall.url.replace("https", "http"), token=token).robots()
    finally:
        hall.close()


def test_values_have_units_quality_and_age(operator: r6.Gateway) -> None:
    assert [(robot.name, robot.is_up) for robot in operator.robots()] == [("arm", True)]
    state = operator.robot("arm").state()
    signal = state.signals["axis-0"]
    # The wire does not tell whether an axis turns or slides.
    assert (signal.unit, signal.quality, signal.value) == (None, "fresh", 0.0)
    assert state.signals["world-0"].unit == "mm"
    assert signal.age is not None and 0 <= signal.age < 5
    assert state.fresh("axis-0") == 0.0
    with pytest.raises(r6.NoReading, match="does not read Addr-800"):
        state.fresh("Addr-800")


def test_a_value_that_is_not_polled_can_be_asked_for(operator: r6.Gateway) -> None:
    arm = operator.robot("arm")
    values = arm.query("Addr-800", "world-0")
    assert (values["Addr-800"].value, values["world-0"].unit, values["world-0"].quality) == (0, "mm", "fresh")
    with pytest.raises(r6.InvalidRequest, match="axis-99"):
        arm.query("axis-99")


def test_a_program_is_checked_and_planned(operator: r6.Gateway) -> None:
    program = "[[instruction]]\ndo = 'axis-move'\nto = [20]\nspeed = 10\n"
    assert operator.check(program)["ok"] is True
    wrong = operator.check(program.replace("speed", "sped"))
    assert (wrong["ok"], [problem["line"] for problem in wrong["problems"]]) == (False, [4])
    planned = operator.plan(program, model="BRTIRUS0707A", start=[5], global_speed=50, sample=0.1)
    assert (planned["ended"], planned["sample_ms"], planned["samples"][0]["axes"][0]) == ("done", 100.0, 5.0)
    assert planned["samples"][-1]["axes"][0] == 20.0
    with pytest.raises(r6.InvalidRequest) as mistaken:
        operator.plan("[[instruction]]", model="BRTIRUS0707A")
    assert mistaken.value.reason == "bad_program"
    with pytest.raises(r6.InvalidRequest, match="model"):
        operator.plan(program, robot="arm")


def test_a_command_needs_the_lease_and_arrives(operator: r6.Gateway, controller: r6.Simulator) -> None:
    arm = operator.robot("arm")
    with arm.lease(5) as lease:
        assert 0 < lease.left <= 5 and not lease.is_stopped
        assert lease.command("modifyOutput", 0, 3, True) >= 0
        assert lease.number > 0 and arm.state().holder is not None
        with pytest.raises(r6.NotSent, match="holds the lease") as held:
            arm.lease()
        assert (held.value.reason, held.value.may_send_again) == ("leased", True)
        lease.renew()
        with pytest.raises(ValueError, match="modifyGSPD"):
            lease.command("modifyGSDP", 5)
    assert arm.state().holder is None
    with pytest.raises(r6.NotSent) as ended:
        lease.command("modifyOutput", 0, 3, False)
    assert (ended.value.reason, ended.value.may_send_again) == ("no_lease", False)
    with r6.Robot.connect(controller.address) as robot:
        assert robot.is_on("Y013")


def test_a_stop_holds_until_it_is_cleared(operator: r6.Gateway) -> None:
    arm = operator.robot("arm")
    assert 0 <= arm.stop() < 20
    assert arm.state().is_stopped
    with arm.lease() as lease:
        assert lease.is_stopped
        with pytest.raises(r6.NotSent) as stopped:
            lease.command("startButton")
        assert (stopped.value.reason, stopped.value.may_send_again) == ("stopped", False)
        lease.clear_stopped()
        assert not arm.state().is_stopped


def test_the_panel_of_a_twin_needs_the_lease_and_its_stop_holds(
    program: Path, tmp_path: Path, controller: r6.Simulator
) -> None:
    hall = Hall(program, tmp_path / "data", controller, "--twins")
    try:
        gateway = r6.Gateway(hall.url, token=hall.token("--role", "engineer"))
        twin, end = gateway.robot("arm-twin"), monotonic() + 30
        while not twin.state().is_up:
            assert monotonic() < end, gateway.robots()
            sleep(0.02)
        assert twin.panel()["virtual"] is True
        with twin.lease() as lease:
            assert lease.panel("set_input", point="X010", on=True)["inputs_on"] == ["X010"]
            with pytest.raises(r6.NotSent) as refused:
                lease.panel("jog", axis="J1", by=10)
            assert refused.value.reason == "not_manual"
            assert twin.panel_stop("emergency_stop")["emergency_stop"] is True
            with pytest.raises(r6.NotSent) as refused:
                lease.panel("press", button="start")
            assert refused.value.reason == "stopped"
            assert lease.panel("release_emergency_stop")["emergency_stop"] is False
        with pytest.raises(r6.InvalidRequest) as none:
            gateway.robot("arm").panel()
        assert none.value.reason == "no_panel"
    finally:
        hall.close()


def test_what_happened_and_the_figures_are_read_later(operator: r6.Gateway, controller: r6.Simulator) -> None:
    # The key changes the mode for certain. A stop does not, if a test at another gateway has stopped the arm before.
    arm = operator.robot("arm")

    def turned(key: Literal["manual", "auto"]) -> dict[str, Any]:
        controller.turn_key(key)
        end = monotonic() + 30
        while True:
            modes = list(arm.history_events(kinds=["mode_changed"]))
            if modes and (modes[-1]["to"] == 1) == (key == "manual"):
                return modes[-1]
            assert monotonic() < end, list(arm.history_events())
            sleep(0.05)

    there = turned("manual")
    # The gateway has seen it: other tests command this arm.
    back = turned("auto")
    assert (there["event"], back["event"], back["from"]) == ("mode_changed", "mode_changed", 1) and there["from"] != 1
    first = arm.production()
    assert first["availability"]["definition"] == "running_of_seen_time"
    assert first["seen_ms"] > 0 and first["seen_ms"] + first["unseen_ms"] == pytest.approx(86_400_000)
    with pytest.raises(r6.InvalidRequest, match="nearest: `parts`"):
        list(arm.history_events(kinds=["part"]))


def test_values_that_were_read_are_there_later(operator: r6.Gateway, controller: r6.Simulator) -> None:
    arm = operator.robot("arm")
    assert arm.state().fresh("curMode") is not None
    end = monotonic() + 30
    while not (modes := list(arm.history("curMode"))):
        assert monotonic() < end
        sleep(0.05)
    assert {"time", "value"} <= set(modes[-1])
    # A minute is a bucket, of the hour that is asked for.
    buckets = list(arm.history("curMode", bucket="1m"))
    assert 1 <= len(buckets) <= 61 and buckets[-1]["samples"] >= 1 and buckets[-1]["good_ms"] > 0
    assert list(arm.history("curMode", start="2001-01-01T00:00:00Z", end="2001-01-01T01:00:00Z")) == []
    with pytest.raises(r6.InvalidRequest, match="`curMod` is no query address; nearest: `curMold`"):
        list(arm.history("curMod"))


def test_a_camera_with_a_grant_answers_photos_and_sends_points(
    hall: Hall, operator: r6.Gateway, controller: r6.Simulator
) -> None:
    camera = r6.Gateway(hall.url, token=hall.token("--role", "viewer", "--camera", "arm:3"))
    arm, parts = camera.robot("arm"), [r6.Point(500.5, -20), r6.Point(1, 2, z=3, angle=180, color=7, relative=True)]
    events = camera.events(robot="arm")
    with pytest.raises(r6.NotSent) as refused:
        operator.robot("arm").add_points(3, parts)
    assert refused.value.reason == "not_allowed"
    with pytest.raises(r6.NotSent) as early:
        arm.answer_photo(3)
    assert early.value.reason == "not_ready"
    told = threading.Event()

    def ask() -> None:
        # The stream may not be open yet.
        while not told.wait(0.1):
            controller.request_photo(3)

    asking = threading.Thread(target=ask)
    asking.start()
    try:
        event = next(event for event in events if event.kind == "photo_requested")
    finally:
        told.set()
        asking.join()
    assert event.data["camera"] == 3
    arm.answer_photo(3)
    assert arm.add_points(3, parts) == 2
    with pytest.raises(r6.InvalidRequest, match="1 to 50 points"):
        arm.add_points(3, [])


def test_alarms_are_listed_acknowledged_and_shelved(
    hall: Hall, operator: r6.Gateway, controller: r6.Simulator
) -> None:
    arm = operator.robot("arm")
    engineer = r6.Gateway(hall.url, token=hall.token("--role", "engineer")).robot("arm")
    assert arm.alarms(active=True) == [] == operator.alarms(active=True)
    controller.emergency_stop()
    try:
        end = monotonic() + 30
        while not (alarms := operator.alarms(active=True)):
            assert monotonic() < end
            sleep(0.02)
        assert (alarms[0]["robot"], alarms[0]["code"], alarms[0]["acknowledged"]) == ("arm", 7, None)
        number = alarms[0]["id"]
        told = arm.acknowledge(number, "guard door")
        assert told["acknowledged"]["comment"] == "guard door"
        assert arm.acknowledge(number)["acknowledged"] == told["acknowledged"], "the first one stays"
        with pytest.raises(r6.NotSent) as refused:
            arm.shelve(number, 60, "worn")
        assert refused.value.reason == "not_allowed"
        assert engineer.shelve(number, 60, "worn")["shelved"]["reason"] == "worn"
        assert arm.alarms()[0]["shelved"]["reason"] == "worn"
        assert engineer.unshelve(number)["shelved"] is None
        with pytest.raises(r6.InvalidRequest, match="for_ms"):
            engineer.shelve(number, 8 * 3600 + 1, "worn")
        with pytest.raises(r6.InvalidRequest) as missing:
            arm.acknowledge(7)
        assert missing.value.reason == "no_such_alarm"
    finally:
        controller.release_emergency_stop()
        with arm.lease() as lease:
            lease.command("clearAlarm")
    end = monotonic() + 30
    while operator.alarms(active=True):
        assert monotonic() < end
        sleep(0.02)
    assert arm.alarms()[0]["state"] == "ended"


def test_streams_tell_values_and_events(operator: r6.Gateway, controller: r6.Simulator) -> None:
    changes = operator.live(robot="arm", signals=["curAlarm"])
    first = next(changes)
    assert (first.robot, first.kind, list(first.signals)) == ("arm", "snapshot", ["curAlarm"])
    controller.raise_alarm(850)
    change = next(changes)
    assert (change.robot, change.kind, change.signals["curAlarm"].value) == ("arm", "change", 850)
    changes.close()
    controller.clear_alarm()
    resumed = operator.live(robot="arm", signals=["curAlarm"], after=change.id)
    missed = next(resumed)
    assert (missed.kind, missed.signals["curAlarm"].value) == ("change", 0)
    resumed.close()
    anew = operator.live(robot="arm", signals=["curAlarm"], after="1-1")
    reset, snapshot = next(anew), next(anew)
    assert (reset.kind, reset.robot, snapshot.kind, snapshot.robot) == ("reset", None, "snapshot", "arm")
    assert reset.id == "" and snapshot.id.count("-") == 1
    anew.close()
    events = operator.events(robot="arm")
    found = threading.Event()
    heard: list[r6.GatewayEvent] = []

    def listen() -> None:
        for event in events:
            heard.append(event)
            if event.kind == "lease_ended" and len(heard) > 1:
                found.set()
                return

    listener = threading.Thread(target=listen)
    listener.start()
    end = monotonic() + 30
    # The stream opens in the thread, so the first leases may be from before it.
    while not found.is_set() and monotonic() < end:
        operator.robot("arm").lease().release()
        sleep(0.05)
    listener.join(10)
    kinds = [event.kind for event in heard]
    assert "lease_ended" in kinds, kinds
    with pytest.raises(ValueError, match="no id"):
        next(operator.events(after="1\r\nX: y"))
    again = next(operator.events(robot="arm", after=heard[0].id))
    assert again.id != heard[0].id and again.robot == "arm"


def test_roles_and_wrong_names_are_refused_with_their_code(hall: Hall, operator: r6.Gateway) -> None:
    viewer = r6.Gateway(hall.url, token=hall.token("--role", "viewer"))
    assert viewer.robot("arm").state().is_up
    for call in (viewer.robot("arm").lease, viewer.robot("arm").stop, viewer.audit):
        with pytest.raises(r6.NotSent) as refused:
            call()
        assert refused.value.reason == "not_allowed", call
    with pytest.raises(r6.NotSent) as unknown:
        r6.Gateway(hall.url, token="0" * 64).robots()
    assert unknown.value.reason == "no_token"
    with pytest.raises(r6.InvalidRequest, match="no robot `a/b c`") as nobody:
        operator.robot("a/b c").state()
    assert nobody.value.reason == "no_such_robot"


def test_only_the_robot_that_a_person_looked_at_is_accepted(hall: Hall) -> None:
    engineer = r6.Gateway(hall.url, token=hall.token("--role", "engineer"))
    with pytest.raises(r6.NotSent) as another:
        engineer.robot("arm").accept_identity({"firmware": "x", "machine_name": "y", "axis_count": 6})
    assert (another.value.reason, another.value.may_send_again) == ("identity_changed", False)


def test_the_audit_log_is_for_engineers(hall: Hall, operator: r6.Gateway) -> None:
    operator.robot("arm").lease().release()
    engineer = r6.Gateway(hall.url, token=hall.token("--role", "engineer"))
    entries = engineer.audit(limit=1000)
    assert [entry["number"] for entry in entries] == list(range(1, len(entries) + 1))


class Lossy:
    """A way to a gateway that passes requests on and swallows the first answer to a command."""

    def __init__(self, url: str) -> None:
        self._to = ("127.0.0.1", int(url.rsplit(":", 1)[1]))
        self.commands: list[bytes] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                with near, socket.create_connection(self._to) as far, suppress(OSError):
                    request = whole_request(near)
                    far.sendall(request)
                    answer = b"".join(iter(lambda: far.recv(65536), b""))
                    if b"/commands " in request:
                        self.commands.append(request)
                        if len(self.commands) == 1:
                            continue
                    near.sendall(answer)

    def close(self) -> None:
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()


def test_a_command_whose_answer_is_lost_reaches_the_robot_once(hall: Hall, operator: r6.Gateway) -> None:
    way = Lossy(hall.url)
    lossy = r6.Gateway(way.url, token=hall.token("--role", "operator"))
    engineer = r6.Gateway(hall.url, token=hall.token("--role", "engineer"))

    def intents() -> int:
        return sum(entry["what"] == "command_intent" for entry in engineer.audit(limit=1000))

    before = intents()
    with lossy.robot("arm").lease() as lease:
        assert lease.command("modifyOutput", 0, 3, True) >= 0
        assert len(way.commands) == 2 and intents() == before + 1
        # With a key of its own, a second call gets the answer of the first one.
        took = lease.command("modifyOutput", 0, 4, True, key="mine")
        assert lease.command("modifyOutput", 0, 4, True, key="mine") == took
        with pytest.raises(r6.InvalidRequest) as taken:
            lease.command("modifyOutput", 0, 4, False, key="mine")
        assert taken.value.reason == "key_taken"
        with pytest.raises(ValueError, match="Idempotency-Key"):
            lease.command("modifyOutput", 0, 4, False, key="two words")
    assert intents() == before + 2
    way.close()


MOVES = """
[[instruction]]
do = "axis-move"
to = [{first}, 0, 0, 0, 0, 0]
speed = {speed}
[[instruction]]
do = "axis-move"
to = [{second}, 0, 0, 0, 0, 0]
speed = {speed}
"""


def start_again(arm: r6.GatewayRobot, lease: r6.GatewayLease) -> None:
    """Starts the program of the controller, which a stop of another test has ended: it takes no lists before."""
    if lease.is_stopped:
        lease.clear_stopped()
    lease.command("startButton", run_leftover=True)
    end = monotonic() + 30
    while arm.query("curMode")["curMode"].value != 7:
        assert monotonic() < end
        sleep(0.02)


def test_a_program_runs_once_and_its_end_is_proved(operator: r6.Gateway) -> None:
    arm = operator.robot("arm")
    text = MOVES.format(first=5, second=8, speed=100)
    with arm.lease(2) as lease:
        start_again(arm, lease)
        run = lease.run(text, repeat=2, key="once")
        assert run.wait(60).is_done and run.because == "finished" and (run.done, run.steps) == (4, 4)
        assert arm.query("axis-0")["axis-0"].value == pytest.approx(8)
        again = lease.run(text, repeat=2, key="once")
        assert again.number == run.number and arm.run(run.number).is_done
        newest = next(arm.runs())
        assert (newest.number, newest.state, newest.done) == (run.number, "done", 4)
        with pytest.raises(r6.InvalidRequest) as other:
            lease.run(text, key="once")
        assert other.value.reason == "key_taken"
        with pytest.raises(r6.InvalidRequest) as wrong:
            lease.run("[[instruction]]\ndo = \"axis-mve\"\n")
        assert wrong.value.reason == "bad_program"
        with pytest.raises(r6.InvalidRequest):
            lease.run(name="not-there")
        with pytest.raises(ValueError):
            lease.run(text, key="a b")
        with pytest.raises(r6.InvalidRequest):
            arm.run(99_999)


def test_waiting_for_a_run_renews_its_lease_and_giving_it_back_stops_the_arm(operator: r6.Gateway) -> None:
    arm = operator.robot("arm")
    with arm.lease(2) as lease:
        start_again(arm, lease)
        run = lease.run(MOVES.format(first=60, second=-60, speed=1))
        with pytest.raises(TimeoutError):
            run.wait(3)
        assert run.state == "running" and lease.left > 0
        assert "running" in repr(run)
    stopped = run.wait(60)
    assert (stopped.state, stopped.because, stopped.is_done) == ("stopped", "lease_released", False)
    assert arm.query("isMoving")["isMoving"].value is False
