"""Programs and points that a gateway keeps, in ``r6.Gateway``: at a gateway of this repository, and at peers that
misbehave."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator
from time import monotonic, sleep
from typing import Any

import pytest
from halls import Hall, r6_program
from test_gateway_peers import LEASE, Peer, answer

import r6

TURN = '[[instruction]]\ndo = "axis-move"\nto = [{degrees}, 0, 0, 0, 0, 0]\nspeed = 100\n'


@pytest.fixture(scope="module")
def controller() -> Iterator[r6.Simulator]:
    with r6.Simulator() as controller:
        yield controller


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory, controller: r6.Simulator) -> Iterator[Hall]:
    hall = Hall(r6_program(), tmp_path_factory.mktemp("library") / "data", controller)
    yield hall
    hall.close()


@pytest.fixture(scope="module")
def engineer(hall: Hall) -> r6.Gateway:
    """A client that may store, and the robot answers."""
    gateway = r6.Gateway(hall.url, token=hall.token("--role", "engineer"))
    end = monotonic() + 30
    while not gateway.robot("arm").state().is_up:
        assert monotonic() < end, gateway.robots()
        sleep(0.02)
    return gateway


def test_a_program_is_stored_changed_and_removed(engineer: r6.Gateway) -> None:
    text = TURN.format(degrees=3) + "# 模号\n"
    first = engineer.store_program("pick", text)
    assert (first.name, first.version, first.kind, first.ok, first.steps) == ("pick", 1, "instructions", True, 1)
    assert (first.text, first.size) == (text, len(text.encode()))
    assert first.sha256 == hashlib.sha256(text.encode()).hexdigest() and "token" in first.stored_by
    second = engineer.store_program("pick", "[[instruction]]", expected=first)
    assert (second.version, second.ok) == (2, False), "a text with mistakes is stored too"
    # The version that somebody began from is named by its etag as well.
    third = engineer.store_program("pick", text, expected=second.etag)
    assert third.version == 3 and third.sha256 == first.sha256

    assert engineer.program("pick") == third
    assert engineer.program("pick", 2).text == "[[instruction]]"
    versions = engineer.program_versions("pick")
    assert [(one.version, one.text) for one in versions] == [(3, None), (2, None), (1, None)]
    assert [(one.name, one.version) for one in engineer.programs()] == [("pick", 3)]

    engineer.remove_program("pick", expected=third)
    assert engineer.programs() == []


def test_nothing_is_replaced_that_the_caller_has_not_seen(engineer: r6.Gateway) -> None:
    first = engineer.store_program("shared", "one")
    with pytest.raises(r6.InvalidRequest, match="in use") as needed:
        engineer.store_program("shared", "two")
    assert (needed.value.reason, needed.value.may_send_again) == ("needs_if_match", False)
    second = engineer.store_program("shared", "two", expected=first)
    stale: list[Callable[[], object]] = [
        lambda: engineer.store_program("shared", "three", expected=first),
        lambda: engineer.remove_program("shared", expected=first),
        lambda: engineer.store_program("new", "three", expected='"1-0000000000000000"'),
    ]
    for change in stale:
        with pytest.raises(r6.NotSent, match="read it again") as changed:
            change()
        assert (changed.value.reason, changed.value.may_send_again) == ("not_this_version", False)
    assert engineer.program("shared") == second
    with pytest.raises(ValueError, match="a version of 'shared', and not of 'other'"):
        engineer.store_program("other", "three", expected=second)
    with pytest.raises(ValueError, match="etag"):
        engineer.remove_program("shared", expected='"1"\r\nX: y')
    engineer.remove_program("shared", expected=second)
    for missing in (lambda: engineer.program("shared"), lambda: engineer.program_versions("a/b c")):
        with pytest.raises(r6.InvalidRequest) as gone:
            missing()
        assert gone.value.reason == "no_such_program"


def test_what_cannot_be_stored_says_why(hall: Hall, engineer: r6.Gateway) -> None:
    with pytest.raises(r6.InvalidRequest, match="a to z") as named:
        engineer.store_program("Pick 1", "one")
    assert named.value.reason == "bad_value"
    with pytest.raises(r6.InvalidRequest) as long:
        engineer.store_program("long", "#" * (256 * 1024 + 1))
    assert long.value.reason == "bad_value"
    with pytest.raises(ValueError, match="surrogates"):
        engineer.store_program("half", "# \ud83d")
    operator = r6.Gateway(hall.url, token=hall.token("--role", "operator"))
    for change in (lambda: operator.store_program("mine", "one"), lambda: operator.store_point("mine", axes=[1])):
        with pytest.raises(r6.NotSent) as refused:
            change()
        assert refused.value.reason == "not_allowed"
    assert operator.programs() == [] and operator.points() == []


def test_a_kept_program_runs_only_as_it_was_looked_at(hall: Hall, engineer: r6.Gateway) -> None:
    arm = engineer.robot("arm")
    old = engineer.store_program("turn", TURN.format(degrees=4))
    new = engineer.store_program("turn", TURN.format(degrees=9), expected=old)
    with arm.lease() as lease:
        with pytest.raises(r6.NotSent, match=new.sha256) as other:
            lease.run(name="turn", sha256=old.sha256)
        assert (other.value.reason, other.value.may_send_again) == ("other_text", False)
        assert arm.query("axis-0")["axis-0"].value == 0.0
        run = lease.run(name="turn", version=old.version, sha256=old.sha256, key="looked-at")
        assert run.wait(60).is_done and run.because == "finished" and arm.query("axis-0")["axis-0"].value == pytest.approx(4)
        assert (run.data["program"], run.data["version"], run.data["sha256"]) == ("turn", 1, old.sha256)
        again = lease.run(name="turn", version=old.version, sha256=old.sha256, key="looked-at")
        assert again.number == run.number
        latest = lease.run(name="turn").wait(60)
        assert latest.is_done and latest.data["version"] == new.version
        assert arm.query("axis-0")["axis-0"].value == pytest.approx(9)
        with pytest.raises(r6.InvalidRequest) as missing:
            lease.run(name="turn", version=7)
        assert missing.value.reason == "no_such_program"
    engineer.remove_program("turn", expected=new)


def test_a_point_is_stored_changed_and_removed(engineer: r6.Gateway) -> None:
    pose = [531.6, 0, 600.25, 180, 0, 0]
    first = engineer.store_point("above-belt", axes=[0, -10.5, 20], pose=pose, tool=1, work_frame=0, note="20 mm above")
    assert (first.version, first.robot, first.note) == (1, None, "20 mm above")
    assert first.axes == (0, -10.5, 20) and first.pose == tuple(pose)
    assert (first.tool, first.work_frame) == (1, 0)
    with pytest.raises(r6.InvalidRequest) as needed:
        engineer.store_point("above-belt", axes=[1])
    assert needed.value.reason == "needs_if_match"
    # Where the robot stands now; a controller does not tell the tool with its pose.
    second = engineer.store_point("above-belt", robot="arm", expected=first)
    stands = [engineer.robot("arm").query(f"axis-{axis}")[f"axis-{axis}"].value for axis in range(6)]
    assert second.axes is not None and second.axes == pytest.approx(stands)
    assert (second.version, second.robot, second.tool, second.note) == (2, "arm", None, "")
    assert engineer.point("above-belt") == second == engineer.points()[0]
    assert engineer.point("above-belt", 1) == first
    assert engineer.point_versions("above-belt") == [second, first]
    with pytest.raises(r6.NotSent) as changed:
        engineer.remove_point("above-belt", expected=first)
    assert changed.value.reason == "not_this_version"
    engineer.remove_point("above-belt", expected=second.etag)
    with pytest.raises(r6.InvalidRequest) as gone:
        engineer.point("above-belt")
    assert gone.value.reason == "no_such_point"


def test_a_place_that_no_arm_has_is_refused(engineer: r6.Gateway) -> None:
    wrong: list[tuple[dict[str, Any], str]] = [
        ({}, "axes"),
        ({"axes": [0] * 9}, "1 to 8"),
        ({"pose": [0] * 5}, "6 numbers"),
        ({"axes": [2e6]}, "no arm reaches"),
        ({"axes": [0], "tool": 1}, "those of `pose`"),
        ({"axes": [0], "note": "x" * 201}, "200 bytes"),
    ]
    for given, told in wrong:
        with pytest.raises(r6.InvalidRequest, match=told) as refused:
            engineer.store_point("wrong", **given)
        assert refused.value.reason == "bad_value"
    for number in (math.nan, math.inf):
        with pytest.raises(ValueError, match="JSON"):
            engineer.store_point("wrong", axes=[number])
    with pytest.raises(r6.InvalidRequest) as nobody:
        engineer.store_point("wrong", robot="nobody")
    assert nobody.value.reason == "no_such_robot"
    assert engineer.points() == []


HEAD = {
    "name": "pick",
    "version": 3,
    "etag": '"3-9f86d081884c7d65"',
    "sha256": hashlib.sha256(b"one").hexdigest(),
    "stored_at": "2026-11-25T06:00:00Z",
    "stored_by": "token 3",
}
PROGRAM = HEAD | {"bytes": 3, "kind": "instructions", "ok": True, "steps": 1, "program": "one"}
VALUE = {"robot": None, "axes": [1.5], "pose": None, "tool": None, "work_frame": None, "note": ""}
POINT = HEAD | {"value": VALUE}


def said(body: object) -> Peer:
    return Peer(answer("200 OK", json.dumps(body).encode()))


@pytest.mark.parametrize(
    "wrong",
    [
        {"program": "two"},
        {"program": None},
        {"program": "one\ud83d"},
        {"sha256": "9F" * 32},
        {"sha256": "0" * 64},
        {"bytes": 4},
        {"name": "pick-2"},
        {"version": 4},
        {"version": "3"},
        {"version": True},
        {"version": 0},
        {"etag": '"3"\r\nX: y'},
        {"etag": "3"},
        {"ok": 1},
        {"steps": -1},
        {"stored_by": None},
    ],
)
def test_another_program_than_the_one_asked_for_is_unclear(wrong: dict[str, Any]) -> None:
    peer = said(PROGRAM | wrong)
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        r6.Gateway(peer.url, token="x").program("pick", 3)
    assert (unknown.value.reason, unknown.value.may_send_again) == ("unclear", True)
    peer.close()


@pytest.mark.parametrize(
    "wrong",
    [
        {"axes": None},
        {"axes": []},
        {"axes": [0.0] * 9},
        {"axes": ["1"]},
        {"axes": [True]},
        {"axes": [math.nan]},
        {"axes": [-math.inf]},
        {"axes": [10**400]},
        {"axes": [1.1e6]},
        {"axes": 1.5},
        {"pose": [0.0] * 5},
        {"tool": -1},
        {"tool": 1.5},
        {"note": None},
        {"robot": 4},
    ],
)
def test_a_point_that_no_gateway_keeps_is_unclear(wrong: dict[str, Any]) -> None:
    value = POINT | {"value": VALUE | wrong}
    asked: list[tuple[object, Callable[[r6.Gateway], object]]] = [
        (value, lambda hall: hall.point("pick")),
        ({"points": [value]}, lambda hall: hall.points()),
        ({"versions": [POINT, value]}, lambda hall: hall.point_versions("pick")),
    ]
    for body, ask in asked:
        peer = said(body)
        with pytest.raises(r6.OutcomeUnknown) as unknown:
            ask(r6.Gateway(peer.url, token="x"))
        assert unknown.value.reason == "unclear"
        peer.close()


@pytest.mark.parametrize(
    "body", [{}, [], None, {"programs": 1}, {"programs": [1]}, {"versions": [HEAD]}, {"points": [{}]}]
)
def test_lists_of_another_shape_are_unclear(body: object) -> None:
    peer = said(body)
    hall = r6.Gateway(peer.url, token="x")
    reads: list[Callable[[], object]] = [
        hall.programs,
        hall.points,
        lambda: hall.program_versions("pick"),
        lambda: hall.point_versions("pick"),
    ]
    for read in reads:
        with pytest.raises(r6.OutcomeUnknown) as unknown:
            read()
        assert unknown.value.reason == "unclear"
    peer.close()


@pytest.mark.parametrize("wrong", [{"sha256": "0" * 64}, {"name": "pick-2"}, {"version": None}])
def test_a_change_that_is_not_confirmed_is_unknown_and_is_sent_once(wrong: dict[str, Any]) -> None:
    peer = said(PROGRAM | wrong)
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        r6.Gateway(peer.url, token="x").store_program("pick", "one", expected='"2-9f86d081884c7d65"')
    assert (unknown.value.effect, unknown.value.may_send_again, len(peer.requests)) == ("changes", False, 1)
    peer.close()


def test_a_change_says_which_version_it_is_for() -> None:
    peer = said(PROGRAM)
    hall = r6.Gateway(peer.url, token="x")
    kept = hall.program("pick")
    hall.store_program("pick", "one", expected=kept)
    hall.store_program("pick", "one")
    # It answers with a body.
    with pytest.raises(r6.OutcomeUnknown):
        hall.remove_program("pick", expected=kept)
    tags = [b'\r\nIf-Match: "3-9f86d081884c7d65"\r\n' in request for request in peer.requests]
    assert tags == [False, True, False, True]
    assert peer.requests[3].startswith(b"DELETE /v1/programs/pick ")
    peer.close()


def test_a_robot_that_does_not_say_where_it_stands_stores_nothing() -> None:
    peer = Peer(answer("504 Gateway Timeout", b'{"code": "no_reply", "message": "it did not answer within 2 s"}'))
    with pytest.raises(r6.NotSent, match="nothing was stored: it did not answer") as silent:
        r6.Gateway(peer.url, token="x").store_point("pick", robot="arm")
    assert (silent.value.reason, silent.value.may_send_again) == ("no_reply", True)
    peer.close()
    peer = Peer(answer("504 Gateway Timeout", b'{"code": "outcome_unknown", "message": "the gateway ends"}'))
    with pytest.raises(r6.OutcomeUnknown):
        r6.Gateway(peer.url, token="x").store_point("pick", axes=[1])
    peer.close()


def test_a_run_without_an_answer_is_sent_once() -> None:
    lease = Peer(answer("200 OK", json.dumps(LEASE).encode()))
    held = r6.Gateway(lease.url, token="x").robot("arm").lease()
    lease.close()
    peer = Peer(b"")
    held._robot = r6.Gateway(peer.url, token="x").robot("arm")
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        held.run(name="pick", version=3, sha256="0" * 64)
    assert (unknown.value.effect, unknown.value.may_send_again, len(peer.requests)) == ("moves", False, 1)
    assert b'"sha256": "' + b"0" * 64 + b'"' in peer.requests[0] and b"Idempotency-Key: " in peer.requests[0]
    peer.close()
