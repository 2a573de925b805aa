"""``r6.Gateway`` against peers that misbehave, and with arguments that it refuses."""

from __future__ import annotations

import json
import socket
import threading
from contextlib import suppress
from datetime import datetime, timedelta, timezone
from pathlib import Path
from time import monotonic
from typing import Any

import pytest
from halls import whole_request

import r6


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("127.0.0.1:9780", "not the URL"),
        ("http://user:secret@localhost", "not the URL"),
        ("http://localhost/v1", "not the URL"),
        ("http://192.168.1.10:9780", "everyone on the network"),
        ("ftp://localhost", "not the URL"),
    ],
)
def test_a_wrong_url_is_told_at_once(url: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        r6.Gateway(url, token="x")


def test_a_token_is_checked_and_never_shown(tmp_path: Path) -> None:
    for wrong in ("", "two words", "bad\r\nX-Header: 1"):
        with pytest.raises(ValueError, match="no token"):
            r6.Gateway("http://localhost", token=wrong)
    with pytest.raises(ValueError, match="either"):
        r6.Gateway("http://localhost")
    path = tmp_path / "token"
    path.write_text("Authorization: Bearer marker-of-a-secret\n")
    assert "marker" not in repr(r6.Gateway("http://localhost", token_file=path))


class Peer:
    """Something that is not a gateway. It counts what it is sent."""

    def __init__(self, answer: bytes, *, silent: bool = False, pause: float = 0) -> None:
        self._answer, self._silent, self._pause = answer, silent, pause
        self.requests: list[bytes] = []
        self._ended = threading.Event()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                stream, _ = self._listener.accept()
                with stream, suppress(OSError):
                    self.requests.append(whole_request(stream))
                    if self._pause:
                        for at in range(len(self._answer)):
                            stream.sendall(self._answer[at : at + 1])
                            self._ended.wait(self._pause)
                    else:
                        stream.sendall(self._answer)
                    if self._silent:
                        self._ended.wait(30)

    def close(self) -> None:
        self._ended.set()
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()


def answer(status: str, body: bytes) -> bytes:
    head = f"HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
    return head.encode() + body


LEASE = {"lease": {"number": 1, "secret": "00"}, "expires_in_ms": 10_000, "stopped": False}


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        (b"", "connection_lost"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\n{", "connection_lost"),
        (b"SSH-2.0-OpenSSH\r\n", "connection_lost"),
        (answer("200 OK", b"<html>"), "unclear"),
        (answer("200 OK", b"{}"), "unclear"),
        (answer("200 OK", b'{"after_ms": "soon"}'), "unclear"),
        (answer("200 OK", b'[{"after_ms": 1}]'), "unclear"),
        (b"HTTP/1.1 204 No Content\r\n\r\n", "unclear"),
        (answer("302 Found", b"{}"), "unclear"),
        (answer("500 Internal Server Error", b'{"code": "broken", "message": "m"}'), "broken"),
        (answer("200 OK", b"[" * 100_000), "unclear"),
        (answer("504 Gateway Timeout", b'{"code": "outcome_unknown", "message": "m"}'), "outcome_unknown"),
    ],
)
def test_a_command_without_a_clear_answer_is_unknown_and_has_one_key(said: bytes, reason: str) -> None:
    peer = Peer(said)
    arm = r6.Gateway(peer.url, token="x", timeout=1).robot("arm")
    lease = _lease_of(arm)
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        lease.command("modifyGSPD", 5)
    assert (unknown.value.reason, unknown.value.may_send_again) == (reason, False)
    # Only without an answer it is asked again, with the same key.
    assert (len(peer.requests) > 1) == (reason == "connection_lost")
    keys = {line for request in peer.requests for line in request.split(b"\r\n") if b"Idempotency-Key" in line}
    assert len(keys) == 1
    peer.close()


def test_pages_of_events_are_read_to_the_end() -> None:
    page = {"events": [{"id": "1-1-1", "event": "link_lost"}], "from": "a", "to": "b", "next_cursor": "e1-1-1"}
    peer = Peer(answer("200 OK", json.dumps(page).encode()))
    events = r6.Gateway(peer.url, token="x").robot("arm").history_events()
    assert next(events)["id"] == "1-1-1"
    # A gateway that gives the same place again and again is none: nothing would ever end.
    with pytest.raises(r6.OutcomeUnknown, match="leads back"):
        next(events)
    # The range of the first page stays.
    assert b"history/events? " in peer.requests[0]
    assert b"history/events?from=a&to=b&cursor=e1-1-1 " in peer.requests[1]
    peer.close()


def test_pages_of_the_history_are_read_to_the_end_and_what_is_missing_is_said() -> None:
    page = {"signal": "axis-0", "samples": [{"time": "c", "value": 1.5}], "from": "a", "to": "b", "next_cursor": "t7"}
    peer = Peer(answer("200 OK", json.dumps(page | {"unreadable_chunks": 0}).encode()))
    arm = r6.Gateway(peer.url, token="x").robot("arm")
    samples = arm.history("axis-0", bucket="1m")
    assert next(samples) == {"time": "c", "value": 1.5}
    with pytest.raises(r6.OutcomeUnknown, match="leads back"):
        next(samples)
    assert b"history?signal=axis-0&bucket=1m&limit=10000 " in peer.requests[0]
    assert b"history?signal=axis-0&from=a&to=b&bucket=1m&limit=10000&cursor=t7 " in peer.requests[1]
    # A time has its zone, or it could be another one.
    east = datetime(2026, 11, 25, 7, 30, tzinfo=timezone(timedelta(hours=1)))
    next(arm.history("axis-0", start=east, end="2026-11-25T07:00:00Z"))
    assert b"from=2026-11-25T06%3A30%3A00Z&to=2026-11-25T07%3A00%3A00Z" in peer.requests[2]
    with pytest.raises(ValueError, match="no time zone"):
        arm.history("axis-0", start=datetime(2026, 11, 25))
    peer.close()
    broken = Peer(answer("200 OK", json.dumps(page | {"unreadable_chunks": 2}).encode()))
    with pytest.warns(RuntimeWarning, match="2 chunks of axis-0"):
        next(r6.Gateway(broken.url, token="x").robot("arm").history("axis-0"))
    broken.close()
    left = {"from": "a", "to": "b", "width_ms": 60000, "used": "not_used"}
    old = Peer(answer("200 OK", json.dumps(page | {"unreadable_chunks": 0, "averages": [left]}).encode()))
    with pytest.warns(RuntimeWarning, match="only averages of 60 s from a to b"):
        next(r6.Gateway(old.url, token="x").robot("arm").history("axis-0"))
    old.close()
    lacking = page | {"unreadable_chunks": 0, "averages": [left | {"used": "incomplete"}]}
    partly = Peer(answer("200 OK", json.dumps(lacking).encode()))
    with pytest.warns(RuntimeWarning, match="averages from a to b lack some values"):
        next(r6.Gateway(partly.url, token="x").robot("arm").history("axis-0"))
    partly.close()


def test_pages_of_runs_are_read_to_the_end() -> None:
    run = {"run_id": 7, "state": "done", "steps": 1, "done": 1, "because": "finished", "detail": ""}
    peer = Peer(answer("200 OK", json.dumps({"runs": [run], "next_before": 7}).encode()))
    runs = r6.Gateway(peer.url, token="x").robot("arm").runs()
    assert next(runs).number == 7
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        next(runs)
    assert unknown.value.reason == "unclear"
    assert b"/v1/robots/arm/runs " in peer.requests[0] and b"/runs?before=7 " in peer.requests[1]
    peer.close()


@pytest.mark.parametrize(
    "page",
    [
        b'{"runs": [{"run_id": 7}], "next_before": null}',
        b'{"runs": [{"run_id": {}, "state": "done"}], "next_before": null}',
        b'{"runs": [7], "next_before": null}',
        b'{"runs": [], "next_before": Infinity}',
        b'{"runs": []}',
    ],
)
def test_runs_of_another_shape_are_unclear(page: bytes) -> None:
    peer = Peer(answer("200 OK", page))
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        next(r6.Gateway(peer.url, token="x").robot("arm").runs())
    assert unknown.value.reason == "unclear"
    peer.close()


@pytest.mark.parametrize("page", [{}, {"samples": []}, {"samples": [1], "unreadable_chunks": 0, "next_cursor": None}])
def test_a_history_of_another_shape_is_unclear(page: dict[str, Any]) -> None:
    peer = Peer(answer("200 OK", json.dumps(page).encode()))
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        next(r6.Gateway(peer.url, token="x").robot("arm").history("axis-0"))
    assert (unknown.value.reason, unknown.value.may_send_again) == ("unclear", True)
    peer.close()


def test_a_silent_gateway_is_given_up_in_time() -> None:
    peer = Peer(b"", silent=True)
    arm = r6.Gateway(peer.url, token="x", timeout=0.3).robot("arm")
    begun = monotonic()
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        arm.stop()
    assert unknown.value.reason == "timed_out" and monotonic() - begun < 10
    # A stop does no harm twice.
    assert unknown.value.may_send_again and unknown.value.effect == "stops"
    peer.close()


@pytest.mark.parametrize(
    "said", [b"{}", b'{"took_ms": 1}', b'{"confirmed": false, "took_ms": 1}', b'{"confirmed": 1, "took_ms": 1}']
)
def test_only_a_stop_that_the_gateway_confirms_is_a_stop(said: bytes) -> None:
    peer = Peer(answer("200 OK", said))
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        r6.Gateway(peer.url, token="x").robot("arm").stop()
    assert unknown.value.reason == "unclear"
    peer.close()


def test_a_stop_that_the_database_did_not_confirm_is_not_called_unsent() -> None:
    peer = Peer(answer("503 Service Unavailable", b'{"code": "store_unavailable", "message": "the arm stands"}'))
    with pytest.raises(r6.OutcomeUnknown, match="the arm stands") as unknown:
        r6.Gateway(peer.url, token="x").robot("arm").stop()
    assert unknown.value.reason == "store_unavailable" and unknown.value.may_send_again
    peer.close()


def test_an_answer_that_comes_too_slowly_is_given_up_in_time() -> None:
    """Each byte comes within the time-out of the socket, and the whole answer does not."""
    peer = Peer(answer("200 OK", b'{"confirmed": true, "took_ms": 1}'), pause=0.1)
    begun = monotonic()
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        r6.Gateway(peer.url, token="x", timeout=0.5).robot("arm").stop()
    assert unknown.value.reason == "timed_out" and monotonic() - begun < 5
    peer.close()


def test_alarms_that_are_not_known_are_an_error_unless_a_part_is_wanted() -> None:
    body = b'{"alarms": [], "left_out": 0, "not_known": ["press", "saw"]}'
    peer = Peer(answer("200 OK", body))
    hall = r6.Gateway(peer.url, token="x")
    with pytest.raises(r6.NotSent, match="press, saw") as refused:
        hall.alarms()
    assert refused.value.reason == "no_owner"
    assert hall.alarms(partial=True) == []
    peer.close()


@pytest.mark.parametrize("said", [b"{}", b'{"robots": [{}]}', b'{"robots": 1}', b'{"robots": [1]}'])
def test_values_of_another_shape_are_an_error_of_the_package(said: bytes) -> None:
    peer = Peer(answer("200 OK", said))
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        r6.Gateway(peer.url, token="x").robots()
    assert unknown.value.reason == "unclear"
    peer.close()


def test_a_change_of_another_shape_is_an_error_of_the_package() -> None:
    message = b'event: change\ndata: {"robot": "arm", "signals": [{}]}\n\n'
    peer = Peer(b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\r\n" + message)
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        next(r6.Gateway(peer.url, token="x").live())
    assert unknown.value.reason == "unclear"
    peer.close()


def test_nothing_is_sent_if_nothing_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(r6.NotSent) as lost:
        r6.Gateway(f"http://127.0.0.1:{port}", token="x").robots()
    assert (lost.value.reason, lost.value.may_send_again) == ("unreachable", True)


@pytest.mark.parametrize(
    "said",
    [b"data: {}", b"data: [1]\n\n", b"event: change\ndata: {\n\n", b"data: " + b"1" * 2_000_000, b""],
)
def test_a_stream_that_breaks_is_lost_and_not_silent(said: bytes) -> None:
    peer = Peer(b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\r\n" + said)
    with pytest.raises(r6.OutcomeUnknown) as lost:
        list(r6.Gateway(peer.url, token="x").events())
    assert lost.value.reason == "connection_lost" and lost.value.may_send_again
    peer.close()


def test_a_run_of_which_the_end_is_not_known_raises() -> None:
    data = {"run_id": 7, "state": "unknown", "steps": 2, "done": 0, "because": "link_lost", "detail": "it is gone"}
    peer = Peer(answer("200 OK", json.dumps(data).encode()))
    run = r6.Gateway(peer.url, token="x").robot("arm").run(7)
    with pytest.raises(r6.OutcomeUnknown) as unknown:
        run.wait()
    assert (unknown.value.reason, unknown.value.effect) == ("link_lost", "moves")
    peer.close()


def _lease_of(arm: r6.GatewayRobot) -> r6.GatewayLease:
    peer = Peer(answer("200 OK", json.dumps(LEASE).encode()))
    lease = r6.Gateway(peer.url, token="x").robot("arm").lease()
    peer.close()
    lease._robot = arm
    return lease
