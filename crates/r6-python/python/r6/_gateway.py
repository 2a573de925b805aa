"""A hall's robots over the gateway (``r6 gateway``): ``Gateway``. It needs no connection to a robot."""

from __future__ import annotations

import http.client
import ipaddress
import json
import socket
import ssl
import threading
import uuid
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic, sleep
from types import TracebackType
from typing import Any, Literal, TypeVar
from urllib.parse import quote, urlencode, urlsplit

from ._errors import InvalidRequest, NoReading, NotSent, OutcomeUnknown, Refused, RequestError
from ._r6 import Command

DEFAULT_PORT = 9780

_MOST_BYTES = 8 * 1024 * 1024
"""The longest answer: twice a page of 1000 audit entries of 4 KiB. A longer one is not from a gateway."""

_MOST_LINE_BYTES = 1024 * 1024
"""The longest line of a stream. A robot has some 220 values at most, each of some hundred bytes."""

_SILENCE = 40.0
"""Seconds without a byte after which a stream counts as lost. The gateway sends something every 15 s."""

_AGAIN = frozenset(
    {
        "leased",
        "run_under_way",
        "in_progress",
        "not_ready",
        "too_many_requests",
        "overloaded",
        "store_unavailable",
        "unreachable",
    }
)
"""Reasons of what was not sent that can pass by themselves."""

_LOOK = 0.1
"""Seconds between two looks at a run: ten requests a second, of the 100 that a token can make."""

_UNREADABLE = (KeyError, TypeError, ValueError, AttributeError)
"""What reading an answer raises if it has another shape than a gateway's."""

Effect = Literal["reads", "changes", "moves", "stops"]

T = TypeVar("T")


@dataclass(frozen=True)
class GatewaySignal:
    """A value that the gateway reads again and again."""

    address: str
    """The query address, such as ``"axis-0"`` for J1."""
    value: Any
    """A text, a number, a flag, a list of texts or a ``dict``. ``None`` without a value."""
    unit: str | None
    """``"deg"``, ``"mm"``, ``"%"``, …; ``None`` if it has none or the protocol does not tell it."""
    quality: str
    """``"fresh"``; ``"stale"``: do not act on it; ``"none"``: there is no value."""
    age: float | None
    """Seconds since the value was asked for, when the gateway answered. ``None`` without a value."""

    @classmethod
    def _of(cls, data: Mapping[str, Any]) -> GatewaySignal:
        age = data.get("age_ms")
        age = None if age is None else age / 1000
        return cls(data["address"], data.get("value"), data.get("unit"), data["quality"], age)


@dataclass(frozen=True)
class GatewayState:
    """A robot as the gateway knows it."""

    name: str
    is_up: bool
    """Whether it answers."""
    is_stopped: bool
    """Whether a stop holds: nothing moves until it is cleared."""
    holder: str | None
    """Who holds the lease; ``None`` if it is free."""
    signals: Mapping[str, GatewaySignal]
    """Its values by their addresses. Empty in ``Gateway.robots``."""
    data: Mapping[str, Any] = field(repr=False)
    """All that the gateway said, as in ``GET /v1/openapi.json``."""

    def fresh(self, address: str) -> Any:
        """The value of an address. ``NoReading`` unless it is fresh."""
        signal = self.signals.get(address)
        if signal is None:
            raise NoReading(f"{self.name}: the gateway does not read {address}: name it in `read` of the robot")
        if signal.quality != "fresh":
            raise NoReading(f"{self.name}: {address} is {signal.quality}, not fresh")
        return signal.value

    @classmethod
    def _of(cls, data: Mapping[str, Any]) -> GatewayState:
        lease = data.get("lease")
        holder = None if lease is None else lease["holder"]
        return cls(data["name"], data["link"] == "up", data["stopped"], holder, _signals(data), data)


@dataclass(frozen=True)
class GatewayChange:
    """Values of one robot in ``Gateway.live``."""

    robot: str | None
    """``None`` only for the ``"reset"`` of all robots."""
    kind: str
    """``"snapshot"``: all values; ``"change"``: those that changed; ``"removed"``: the robot is gone;
    ``"reset"``: something was missed, so forget the values of the robot: a snapshot follows."""
    signals: Mapping[str, GatewaySignal]
    id: str = ""
    """Pass it as ``after`` to go on there. Empty while messages of the same moment follow: keep the last one
    that is not empty."""


@dataclass(frozen=True)
class GatewayEvent:
    """Something that happened, in ``Gateway.events``."""

    id: str
    """Pass it as ``after`` to go on behind it. Empty for ``"reset"``."""
    kind: str
    """``"link_up"``, ``"lease_began"``, ``"stop_began"``, …; ``"reset"``: events before the next one are
    lost."""
    robot: str | None
    time: str | None
    """RFC 3339, UTC."""
    data: Mapping[str, Any]
    """All that the gateway said of it."""


Changes = Generator[GatewayChange, None, None]
Events = Generator[GatewayEvent, None, None]


class Gateway:
    """A gateway. It holds no connection: each call makes its own, so it can be used from several threads.

    Errors are those of ``Robot``; ``reason`` is the code of the gateway's problem (``"leased"``,
    ``"not_allowed"``, …). No request is sent twice.

    >>> press = r6.Gateway("http://127.0.0.1:9780", token_file="token").robot("press-4")    # doctest: +SKIP
    >>> press.state().fresh("axis-0")    # doctest: +SKIP
    0.0
    >>> with press.lease() as lease:    # doctest: +SKIP
    ...     accepted_after = lease.command("modifyGSPD", 5)
    """

    def __init__(
        self,
        url: str,
        *,
        token: str | None = None,
        token_file: str | Path | None = None,
        ca_file: str | Path | None = None,
        insecure_http: bool = False,
        timeout: float = 30.0,
    ) -> None:
        """``url``: such as ``"http://127.0.0.1:9780"``; without a port, 9780. ``token``: what ``r6 gateway token``
        prints; or ``token_file``, a file with it. ``ca_file``: the certificate of the gateway or of who issued
        it, for ``https``. ``insecure_http``: send the token without TLS to another machine, where everyone
        on the network can read it. ``timeout``: seconds for an answer; a stop takes up to 20.

        ``ValueError`` if something of this is wrong. Nothing is sent yet.
        """
        parts = urlsplit(url)
        wrong = parts.username or parts.password or parts.path not in ("", "/") or parts.query or parts.fragment
        if parts.scheme not in ("http", "https") or not parts.hostname or wrong:
            raise ValueError(f"{url!r} is not the URL of a gateway, such as http://127.0.0.1:9780")
        if (token is None) == (token_file is None):
            raise ValueError("give either token or token_file; `r6 gateway token` makes a token")
        if token_file is not None:
            token = Path(token_file).read_text(encoding="utf-8")
        self._token = _plain_token(token or "")
        self._host = parts.hostname
        self._port = parts.port or DEFAULT_PORT
        self._timeout = timeout
        self._tls: ssl.SSLContext | None = None
        if parts.scheme == "https":
            self._tls = ssl.create_default_context(cafile=None if ca_file is None else str(ca_file))
        elif not (insecure_http or _is_this_machine(self._host)):
            raise ValueError(
                f"{url}: everyone on the network could read the token: use https, or insecure_http=True"
            )

    def __repr__(self) -> str:
        scheme = "http" if self._tls is None else "https"
        return f"Gateway({scheme}://{self._host}:{self._port})"

    def robots(self) -> list[GatewayState]:
        """All robots that the token may see, without their values."""
        return self._ask("GET", "/v1/robots", lambda answer: [GatewayState._of(data) for data in answer["robots"]])

    def robot(self, name: str) -> GatewayRobot:
        """The handle of a robot. Nothing is sent yet."""
        return GatewayRobot(self, name)

    def live(
        self, *, robot: str | None = None, signals: list[str] | None = None, after: str | None = None
    ) -> Changes:
        """Values as they change: of all robots or of one, all values or these addresses. A robot begins with
        a snapshot. A slow reader gets the latest values and misses those in between. Leaving the loop ends the
        stream.

        ``after``: go on at the ``id`` of a change, when the stream was lost. Then only what changed meanwhile
        comes, or a ``"reset"`` and snapshots if the gateway does not know that any more.

        Raises ``OutcomeUnknown`` when the stream is lost, and ``NotSent`` if it cannot be opened.
        """
        asked = {"robot": robot, "signal": None if signals is None else ",".join(signals)}
        for number, kind, data in self._stream("/v1/live", asked, after):
            try:
                name = data["name" if kind == "snapshot" else "robot"]
                change = GatewayChange(name, kind, _signals(data), number)
            except _UNREADABLE as error:
                raise self._unclear("GET", "/v1/live", "reads", f"a {kind} that cannot be read") from error
            yield change

    def events(self, *, robot: str | None = None, after: str | None = None) -> Events:
        """What happens from now on, or behind the event with the id ``after``: links, leases, stops, commands.

        Errors as for ``live``.
        """
        for number, kind, data in self._stream("/v1/events", {"robot": robot}, after):
            happened = data.get("event", kind)
            yield GatewayEvent(number, happened, data.get("robot"), data.get("time"), data)

    def alarms(self, *, active: bool = False) -> list[dict[str, Any]]:
        """The alarms of all robots that the token may see: the active ones first, then those that ended within a
        day, the latest first, at most 1000. With ``active`` only those that have not ended. ``["acknowledged"]``
        and ``["shelved"]`` say by whom, or are ``None``.
        """
        path = f"/v1/alarms?{urlencode({'active': json.dumps(active), 'limit': 1000})}"
        return self._ask("GET", path, _alarms)

    def audit(self, *, after: int = 0, limit: int = 100) -> list[dict[str, Any]]:
        """Entries of the audit log behind a number, oldest first, at most 1000. Engineers only."""
        path = f"/v1/audit?{urlencode({'after': after, 'limit': limit})}"
        return self._ask("GET", path, lambda answer: list(answer["entries"]))

    def check(self, program: str) -> dict[str, Any]:
        """The mistakes of the text of a program (the first 20, and how many more), and where each step can run: what ``POST /v1/programs/check``
        answers. ``["ok"]`` says whether there is no mistake. Nothing is sent to a robot.
        """
        return self._ask("POST", "/v1/programs/check", dict, {"program": program})

    def plan(
        self,
        program: str,
        *,
        model: str | None = None,
        robot: str | None = None,
        start: Sequence[float] | None = None,
        global_speed: float | None = None,
        sample: float | None = None,
    ) -> dict[str, Any]:
        """What an arm would do: what ``POST /v1/programs/plan`` answers. No robot moves.

        Give either ``model`` or ``robot``, which begins where that robot stands. ``start``: positions of the
        axes, J1 first, degrees or mm. ``global_speed``: percent. ``sample``: seconds between two samples, 0.002
        to 10.

        ``InvalidRequest`` if the program has mistakes (``reason`` is ``"bad_program"``) or a value is wrong;
        ``NotSent`` if the position of the robot is not known.
        """
        asked: dict[str, Any] = {"program": program, "model": model, "robot": robot}
        asked["from"] = None if start is None else list(start)
        asked["global_speed_percent"] = global_speed
        asked["sample_ms"] = None if sample is None else round(sample * 1000)
        given = {name: value for name, value in asked.items() if value is not None}
        return self._ask("POST", "/v1/programs/plan", dict, given)

    def _connect(self, timeout: float) -> http.client.HTTPConnection:
        """Makes a connection. Nothing is sent over it yet."""
        connection: http.client.HTTPConnection
        if self._tls is None:
            connection = http.client.HTTPConnection(self._host, self._port, timeout=timeout)
        else:
            connection = http.client.HTTPSConnection(self._host, self._port, timeout=timeout, context=self._tls)
        try:
            connection.connect()
        except ssl.SSLCertVerificationError as error:
            advice = "the certificate.pem of the gateway, or that of who issued it, goes into ca_file"
            raise _not_sent("unreachable", f"{self!r} is not trusted: {error}: {advice}") from error
        except OSError as error:
            raise _not_sent("unreachable", f"{self!r} cannot be reached: {error}") from error
        return connection

    def _send(
        self,
        connection: http.client.HTTPConnection,
        method: str,
        path: str,
        body: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> http.client.HTTPResponse:
        """Sends a request once."""
        named = {"Authorization": f"Bearer {self._token}", "Connection": "close", **(headers or {})}
        if body is not None:
            named["Content-Type"] = "application/json"
        connection.request(method, path, body=body, headers=named)
        return connection.getresponse()

    def _lost(self, method: str, path: str, effect: Effect, error: Exception) -> OutcomeUnknown:
        reason = "timed_out" if isinstance(error, TimeoutError) else "connection_lost"
        problem = OutcomeUnknown(f"{self!r} gave no answer to {method} {path.split('?')[0]}: {error}")
        problem.reason, problem.effect, problem.may_send_again = reason, effect, effect in ("reads", "stops")
        return problem

    def _unclear(self, method: str, path: str, effect: Effect, what: str) -> OutcomeUnknown:
        """Something answered, and not as a gateway does."""
        problem = OutcomeUnknown(f"{self!r} answered {method} {path.split('?')[0]} with {what}")
        problem.reason, problem.effect, problem.may_send_again = "unclear", effect, effect in ("reads", "stops")
        return problem

    def _ask(
        self,
        method: str,
        path: str,
        read: Callable[[Any], T],
        body: Mapping[str, Any] | None = None,
        effect: Effect = "reads",
        headers: Mapping[str, str] | None = None,
    ) -> T:
        """Sends a request, and reads the JSON of its answer: ``None`` for an answer without any."""
        data = None if body is None else json.dumps(body, allow_nan=False)
        connection, end = self._connect(self._timeout), monotonic() + self._timeout
        # The time-out of a socket begins anew with each byte.
        cut = threading.Timer(self._timeout, _cut, (connection.sock,))
        cut.daemon = True
        cut.start()
        try:
            with self._send(connection, method, path, data, headers) as response:
                text = response.read(_MOST_BYTES + 1)
                if response.length and len(text) <= _MOST_BYTES:
                    raise EOFError("the answer breaks off")
        except (OSError, EOFError, http.client.HTTPException) as error:
            late = TimeoutError(f"not within {self._timeout:g} s") if monotonic() >= end else error
            raise self._lost(method, path, effect, late) from error
        finally:
            cut.cancel()
            connection.close()
        answer = None if response.status == 204 else _json(text)
        if response.status // 100 != 2:
            raise self._problem(response.status, answer, method, path, effect)
        try:
            return read(answer)
        except _UNREADABLE as error:
            what = f"status {response.status}, and something that cannot be read"
            raise self._unclear(method, path, effect, what) from error

    def _problem(self, status: int, answer: Any, method: str, path: str, effect: Effect) -> RequestError:
        """The error that a problem stands for. What is not a gateway's answer proves nothing."""
        is_problem = isinstance(answer, dict) and isinstance(answer.get("code"), str)
        if not is_problem or status < 400:
            return self._unclear(method, path, effect, f"status {status}, and not as a gateway does")
        code, text = answer["code"], str(answer.get("message", answer["code"]))
        if code in ("outcome_unknown", "not_stopped"):
            unknown = OutcomeUnknown(text)
            unknown.reason, unknown.effect, unknown.may_send_again = code, effect, effect == "stops"
            return unknown
        if code == "refused":
            refused = Refused(text)
            refused.reason = code
            return refused
        if status in (400, 404, 405, 413, 415, 422):
            invalid = InvalidRequest(text)
            invalid.reason = code
            return invalid
        if status in (401, 403, 408, 409, 429, 503):
            return _not_sent(code, text)
        other = OutcomeUnknown(text)
        other.reason, other.effect = code, effect
        return other

    def _stream(
        self, path: str, asked: Mapping[str, str | None], after: str | None
    ) -> Iterator[tuple[str, str, dict[str, Any]]]:
        """The messages of a stream of server-sent events: id, kind, data."""
        wanted = urlencode({name: value for name, value in asked.items() if value is not None})
        path = f"{path}?{wanted}" if wanted else path
        headers = {} if after is None else {"Last-Event-ID": _header(after)}
        connection = self._connect(_SILENCE)
        try:
            try:
                response = self._send(connection, "GET", path, headers=headers)
            except (OSError, http.client.HTTPException) as error:
                raise self._lost("GET", path, "reads", error) from error
            with response:
                if response.status != 200:
                    answer = _json(response.read(_MOST_BYTES))
                    raise self._problem(response.status, answer, "GET", path, "reads")
                yield from self._messages(response, path)
        finally:
            connection.close()

    def _messages(self, response: http.client.HTTPResponse, path: str) -> Iterator[tuple[str, str, dict[str, Any]]]:
        number, kind, data = "", "message", ""
        while True:
            try:
                line = response.readline(_MOST_LINE_BYTES)
            except (OSError, http.client.HTTPException, ValueError) as error:
                raise self._lost("GET", path, "reads", error) from error
            if not line.endswith(b"\n"):
                cause = "the line is too long" if line else "the stream has ended"
                raise self._lost("GET", path, "reads", EOFError(cause))
            name, _, value = line.decode("utf-8", "replace").rstrip("\r\n").partition(":")
            value = value.removeprefix(" ")
            if name == "event":
                kind = value
            elif name == "id":
                number = value
            elif name == "data":
                data += value
                if len(data) > _MOST_BYTES:
                    raise self._lost("GET", path, "reads", EOFError("the message is too long"))
            elif not name and not value and data:
                read = _json(data.encode())
                if not isinstance(read, dict):
                    raise self._lost("GET", path, "reads", EOFError("a message is no JSON object"))
                yield number, kind, read
                number, kind, data = "", "message", ""


class GatewayRobot:
    """The handle of one robot at a gateway, from ``Gateway.robot``."""

    def __init__(self, gateway: Gateway, name: str) -> None:
        self._gateway = gateway
        self.name = name

    def __repr__(self) -> str:
        return f"GatewayRobot({self.name!r}, {self._gateway!r})"

    def state(self) -> GatewayState:
        """The robot with its values, each with unit, quality and age."""
        return self._ask("GET", "", GatewayState._of)

    def query(self, *addresses: str) -> dict[str, GatewaySignal]:
        """Asks the robot for values now, whether the gateway reads them again and again or not: at most 128
        addresses. An address that the robot does not have has the quality ``"none"``.

        ``InvalidRequest`` if an address is wrong. Without a usable answer of the robot ``OutcomeUnknown``, whose
        ``reason`` is ``"no_reply"``: a query changes nothing, so it can be sent again.
        """
        return self._ask("GET", f"/query?{urlencode({'address': ','.join(addresses)})}", _signals)

    def history_events(
        self, *, kinds: list[str] | None = None, start: str | None = None, end: str | None = None
    ) -> Iterator[dict[str, Any]]:
        """What happened, oldest first: alarms, modes, programs, cycles, parts, lost links, and when the gateway
        did not see the robot. ``start`` and ``end`` are RFC 3339 in UTC; without them, the last hour. ``kinds``:
        only these, such as ``["alarm_began", "cycle_done"]``.

        Each page of 1000 events is one request, made when the loop comes to it.
        """
        asked = {"from": start, "to": end, "kind": None if kinds is None else ",".join(kinds)}
        while True:
            query = urlencode({name: value for name, value in asked.items() if value is not None})
            events, more = self._ask("GET", f"/history/events?{query}", _page)
            yield from events
            if more is None:
                return
            asked |= more

    def production(
        self,
        *,
        start: str | None = None,
        end: str | None = None,
        shift: str | None = None,
        date: str | None = None,
        by_shift: bool = False,
    ) -> dict[str, Any]:
        """The figures of production from ``start`` to ``end``, RFC 3339 in UTC, at most 31 days; without them, the
        last day. Times are in milliseconds. What was not seen is ``unseen_ms``, and in no state.

        With ``shift`` and ``date``, such as ``"night"`` and ``"2026-11-25"``, those of this shift. With
        ``by_shift``, ``["shifts"]`` has those of each shift that begins in the range.
        """
        asked = {"from": start, "to": end, "shift": shift, "date": date, "by": "shift" if by_shift else None}
        query = urlencode({name: value for name, value in asked.items() if value is not None})
        return self._ask("GET", f"/production?{query}", dict)

    def alarms(self, *, active: bool = False) -> list[dict[str, Any]]:
        """The alarms of this robot, as ``Gateway.alarms`` has them: the active one, and those that ended within a
        day, at most 30."""
        return self._ask("GET", f"/alarms?{urlencode({'active': json.dumps(active), 'limit': 1000})}", _alarms)

    def acknowledge(self, alarm: int, comment: str | None = None) -> dict[str, Any]:
        """Says that somebody saw the alarm with this ``["id"]``, and returns the alarm. It changes nothing at the
        robot and needs no lease. The first to acknowledge an alarm stays. Operators only.

        ``InvalidRequest`` with the reason ``no_such_alarm``: the robot has no such alarm, or it ended long ago.
        """
        body = {} if comment is None else {"comment": comment}
        return self._ask("POST", f"/alarms/{int(alarm)}/acknowledge", _alarm, body, "changes")

    def shelve(self, alarm: int, duration: float, reason: str) -> dict[str, Any]:
        """Shelves the alarms of the code of this one at this robot for so many seconds, 1 to 28800, those that come
        later too: they need no answer. It changes nothing at the robot and needs no lease. Engineers only."""
        body = {"for_ms": round(duration * 1000), "reason": reason}
        return self._ask("POST", f"/alarms/{int(alarm)}/shelve", _alarm, body, "changes")

    def unshelve(self, alarm: int) -> dict[str, Any]:
        """Takes the alarms of the code of this one from the shelf. Engineers only."""
        return self._ask("DELETE", f"/alarms/{int(alarm)}/shelve", _alarm, None, "changes")

    def run(self, number: int) -> GatewayRun:
        """A run of a program, from its number. The gateway keeps it for 24 h. To begin one: ``GatewayLease.run``."""
        return self._ask("GET", f"/runs/{number}", lambda data: GatewayRun(self, None, data))

    def stop(self) -> float:
        """Stops the robot, and returns the seconds until it was proved that the arm stands. It needs no lease.
        The stop holds until ``GatewayLease.clear_stopped``.

        ``OutcomeUnknown`` with the reason ``not_stopped``: it is not proved. Use the emergency stop.
        """
        return self._ask("POST", "/stop", _took, effect="stops")

    def stop_command(self, word: Literal["actionStop", "actionPause", "stopButton"]) -> None:
        """Sends one command that stops or pauses. It needs no lease and holds as ``stop`` does, but does not
        prove that the arm stands."""
        self._ask("POST", "/commands", _after, {"command": word}, "stops")

    def lease(self, duration: float = 10.0, *, take_because: str | None = None) -> GatewayLease:
        """Acquires the command lease for 2 to 300 seconds. With ``take_because`` an admin takes it from its
        holder; the robot is stopped first.

        ``NotSent`` with the reason ``leased``: another holds it.
        """
        body: dict[str, Any] = {"duration_ms": round(duration * 1000)}
        if take_because is not None:
            body["take_because"] = take_because
        asked = monotonic()
        effect: Effect = "stops" if take_because is not None else "changes"
        return self._ask("POST", "/lease", lambda given: GatewayLease(self, duration, asked, given), body, effect)

    def accept_identity(self, found: Mapping[str, Any]) -> None:
        """Accepts the robot that answers at this address after another one was exchanged for it. ``found`` is
        ``state().data["identity_changed"]["found"]``, read before a person looked at the robot. Engineers only.

        ``NotSent`` with the reason ``identity_changed``: by now another one answers.
        """
        self._ask("POST", "/accept-identity", _nothing, found, "changes")

    def _ask(
        self,
        method: str,
        path: str,
        read: Callable[[Any], T],
        body: Mapping[str, Any] | None = None,
        effect: Effect = "reads",
        headers: Mapping[str, str] | None = None,
    ) -> T:
        path = f"/v1/robots/{quote(self.name, safe='')}{path}"
        return self._gateway._ask(method, path, read, body, effect, headers)


class GatewayLease:
    """The command lease of one robot. It ends by itself unless it is renewed; ``with`` gives it back.

    When a lease ends, a program of the controller that runs goes on. A program that the gateway runs
    (``GatewayLease.run``) is stopped.
    """

    def __init__(self, robot: GatewayRobot, duration: float, asked: float, given: Mapping[str, Any]) -> None:
        self._robot = robot
        self._duration = duration
        self._key = {"number": int(given["lease"]["number"]), "secret": given["lease"]["secret"]}
        self._until: float = asked + given["expires_in_ms"] / 1000
        self.is_stopped: bool = given["stopped"]
        """Whether a stop held when the lease was acquired or renewed."""

    def __enter__(self) -> GatewayLease:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.release()
        except RequestError:
            # It has ended already, or ends by itself soon. An error of the block is not hidden by this.
            pass

    def __repr__(self) -> str:
        return f"GatewayLease({self._robot.name!r}, number {self.number}, {self.left:.1f} s left)"

    @property
    def number(self) -> int:
        """Its number. A robot's next lease has a higher one."""
        return int(self._key["number"])

    @property
    def left(self) -> float:
        """The seconds for which it lasts at least; 0 if it may have ended."""
        return max(0.0, self._until - monotonic())

    def renew(self) -> None:
        """Makes it last as long again. Call it from the code that watches the robot, not from a timer: a
        program that hangs must lose its lease.

        ``NotSent`` with the reason ``no_lease``: it has ended.
        """
        asked = monotonic()
        body = {"renew": self._key, "duration_ms": round(self._duration * 1000)}
        renewed = self._robot._ask(
            "POST",
            "/lease",
            lambda given: GatewayLease(self._robot, self._duration, asked, given),
            body,
            "changes",
        )
        self._until, self.is_stopped = renewed._until, renewed.is_stopped

    def release(self) -> None:
        """Gives it back."""
        self._robot._ask("DELETE", "/lease", _nothing, {"lease": self._key}, "changes")

    def command(self, word: str, *arguments: object, run_leftover: bool = False) -> float:
        """Sends a command, in the words and units of ``r6 command``: ``lease.command("modifyGSPD", 20)``. Returns the
        seconds until the controller accepted it. That does not mean that the arm moves.

        ``run_leftover``: send a command that starts the machine even if instructions are left in its list.
        ``ValueError`` says which word or argument is wrong; nothing is sent then. ``OutcomeUnknown``: look at
        the robot before anything is sent again.
        """
        Command.typed(word, *arguments)
        texts = [str(int(argument)) if isinstance(argument, bool) else str(argument) for argument in arguments]
        body = {"command": word, "arguments": texts, "lease": self._key, "run_leftover": run_leftover}
        return self._robot._ask("POST", "/commands", _after, body, "moves")

    def run(
        self,
        program: str | None = None,
        *,
        name: str | None = None,
        version: int | None = None,
        repeat: int = 1,
        key: str | None = None,
    ) -> GatewayRun:
        """Runs a program on the robot: the text of it, or one that the gateway keeps, by its ``name`` and perhaps
        its ``version``. It runs ``repeat`` times. Returns once the controller accepted the first list;
        ``GatewayRun.wait`` waits for the end. The arm is stopped if the lease ends.

        ``key``: the ``Idempotency-Key``. A second call with the same key and the same arguments gets the same
        run, and moves nothing. Without it, each call has a new one.

        ``InvalidRequest`` if the program has mistakes (``reason`` is ``"bad_program"``); ``NotSent`` if the robot
        is not ready; ``OutcomeUnknown``: look at the robot, or call again with the same ``key``.
        """
        asked: dict[str, Any] = {"program": program, "name": name, "version": version}
        body = {word: value for word, value in asked.items() if value is not None}
        body |= {"lease": self._key, "repeat": repeat}
        headers = {"Idempotency-Key": _header(str(uuid.uuid4()) if key is None else key, "Idempotency-Key")}
        return self._robot._ask(
            "POST",
            "/programs/run",
            lambda data: GatewayRun(self._robot, self, data),
            body,
            "moves",
            headers,
        )

    def clear_stopped(self) -> None:
        """Lets the robot move again after a stop. Look at the robot first."""
        self._robot._ask("POST", "/clear-stopped", _nothing, {"lease": self._key}, "changes")
        self.is_stopped = False


class GatewayRun:
    """A run of a program at a gateway, from ``GatewayLease.run`` or ``GatewayRobot.run``.

    ``state`` is ``"running"``, ``"done"``, ``"stopped"``, ``"refused"``, ``"failed"`` or ``"unknown"``. It is
    ``"done"`` only if it is proved that the arm carried the program out.
    """

    def __init__(self, robot: GatewayRobot, lease: GatewayLease | None, data: Mapping[str, Any]) -> None:
        self._robot = robot
        self._lease = lease
        self._read(data)

    def _read(self, data: Mapping[str, Any]) -> None:
        self.number: int = int(data["run_id"])
        """Its number at this gateway."""
        self.state: str = data["state"]
        self.steps: int = int(data["steps"])
        """The steps of all rounds."""
        self.done: int = int(data["done"])
        """How many of them are done, as far as is seen."""
        self.because: str | None = data["because"]
        """Why it ended: ``"finished"``, ``"lease_expired"``, ``"stop"``, ``"alarm"``, …; ``None`` while it runs."""
        self.detail: str = data["detail"]
        """The same, for people."""
        self.data: Mapping[str, Any] = data
        """All that the gateway said of it."""

    def __repr__(self) -> str:
        return f"GatewayRun({self.number}, {self.state}, {self.done} of {self.steps} steps)"

    @property
    def is_done(self) -> bool:
        """Whether it is proved that the arm carried the program out, and stands."""
        return self.state == "done"

    def look(self) -> GatewayRun:
        """Asks the gateway how it stands, and returns itself."""
        self._read(self._robot._ask("GET", f"/runs/{self.number}", dict))
        return self

    def wait(self, timeout: float | None = None, *, renew: bool = True) -> GatewayRun:
        """Waits until it has ended, and returns itself: look at ``is_done``. If ``GatewayLease.run`` began it, this
        renews the lease when half of it is over, as long as this call waits; ``renew=False`` does not.

        ``TimeoutError`` after ``timeout`` seconds: the run goes on as long as the lease lasts.
        ``OutcomeUnknown`` if its state is ``"unknown"``: look at the arm. Errors of ``look`` and
        ``GatewayLease.renew`` pass through.
        """
        end = None if timeout is None else monotonic() + timeout
        while self.look().state == "running":
            lease = self._lease
            if renew and lease is not None and lease.left < lease._duration / 2:
                lease.renew()
            if end is not None and monotonic() >= end:
                raise TimeoutError(f"run {self.number} has not ended within {timeout:g} s")
            sleep(_LOOK)
        if self.state == "unknown":
            unknown = OutcomeUnknown(f"run {self.number}: {self.detail}")
            unknown.reason, unknown.effect = self.because, "moves"
            raise unknown
        return self


def _plain_token(text: str) -> str:
    """The token, also from a file with the header for curl."""
    token = text.strip()
    header = "authorization: bearer "
    if token.lower().startswith(header):
        token = token[len(header) :].strip()
    if not token or not all("!" <= letter <= "~" for letter in token):
        raise ValueError("this is no token: `r6 gateway token` prints one, a line without blanks")
    return token


def _header(text: str, what: str = "id of an event") -> str:
    if not all("!" <= letter <= "~" for letter in text):
        raise ValueError(f"{text!r} is no {what}")
    return text


def _is_this_machine(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _signals(data: Mapping[str, Any]) -> dict[str, GatewaySignal]:
    signals = [GatewaySignal._of(signal) for signal in data.get("signals", [])]
    return {signal.address: signal for signal in signals}


def _took(answer: Any) -> float:
    """The seconds of a stop that is proved."""
    if answer["confirmed"] is not True:
        raise ValueError("the stop is not confirmed")
    return float(answer["took_ms"]) / 1000


def _after(answer: Any) -> float:
    """The seconds until the controller accepted a command."""
    return float(answer["after_ms"]) / 1000


def _page(answer: Any) -> tuple[list[dict[str, Any]], dict[str, str] | None]:
    """The events of a page, and how to ask for the next one: the range of the first page stays."""
    events, cursor = [dict(event) for event in answer["events"]], answer["next_cursor"]
    if cursor is None:
        return events, None
    return events, {"from": str(answer["from"]), "to": str(answer["to"]), "cursor": str(cursor)}


def _alarm(answer: Any) -> dict[str, Any]:
    """An alarm. What the caller decides by has to be there."""
    if not {"id", "code", "state", "acknowledged", "shelved"} <= set(answer):
        raise ValueError("an alarm without its state")
    return dict(answer)


def _alarms(answer: Any) -> list[dict[str, Any]]:
    return [_alarm(alarm) for alarm in answer["alarms"]]


def _nothing(answer: Any) -> None:
    """Nothing: the answer has no body."""
    if answer is not None:
        raise ValueError("an answer with a body where none was expected")


def _cut(stream: socket.socket) -> None:
    """Ends a connection, also while another thread reads from it."""
    with suppress(OSError):
        socket.socket.shutdown(stream, socket.SHUT_RDWR)


def _json(text: bytes) -> Any:
    """The value of a JSON text; ``None`` if the text is not JSON."""
    if len(text) > _MOST_BYTES:
        return None
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _not_sent(code: str, text: str) -> NotSent:
    problem = NotSent(text)
    problem.reason, problem.may_send_again = code, code in _AGAIN
    return problem
