"""One robot at a gateway: its values, its command lease, its runs."""

from __future__ import annotations

import json
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from time import monotonic, sleep
from types import TracebackType
from typing import Any, Literal
from urllib.parse import quote, urlencode

from ._errors import OutcomeUnknown, RequestError
from ._gateway_http import Effect, HttpClient, T, header
from ._gateway_values import (
    GatewaySignal,
    GatewayState,
    Moment,
    read_after,
    read_alarm,
    read_alarms,
    read_history,
    read_moment,
    read_nothing,
    read_page,
    read_signals,
    read_taken,
    read_took,
)
from ._r6 import Command
from ._types import Point

_LOOK = 0.1
"""Seconds between two looks at a run: ten requests a second, of the 100 that a token can make."""


class GatewayRobot:
    """The handle of one robot at a gateway, from ``Gateway.robot``."""

    def __init__(self, http: HttpClient, name: str) -> None:
        self._http = http
        self.name = name

    def __repr__(self) -> str:
        return f"GatewayRobot({self.name!r}, {self._http!r})"

    def state(self) -> GatewayState:
        """The robot with its values, each with unit, quality and age."""
        return self._ask("GET", "", GatewayState._of)

    def query(self, *addresses: str) -> dict[str, GatewaySignal]:
        """Asks the robot for values now, whether the gateway reads them again and again or not: at most 128
        addresses. An address that the robot does not have has the quality ``"none"``.

        ``InvalidRequest`` if an address is wrong. Without a usable answer of the robot ``OutcomeUnknown``, whose
        ``reason`` is ``"no_reply"``: a query changes nothing, so it can be sent again.
        """
        return self._ask("GET", f"/query?{urlencode({'address': ','.join(addresses)})}", read_signals)

    def history_events(
        self, *, kinds: list[str] | None = None, start: Moment | None = None, end: Moment | None = None
    ) -> Iterator[dict[str, Any]]:
        """What happened, oldest first: alarms, modes, programs, cycles, parts, lost links, and when the gateway
        did not see the robot. ``start`` and ``end``: a ``datetime`` with its time zone, or RFC 3339 in UTC; without them,
        the last hour. ``kinds``:
        only these, such as ``["alarm_began", "cycle_done"]``.

        Each page of 1000 events is one request, made when the loop comes to it.
        """
        kind = None if kinds is None else ",".join(kinds)
        return self._pages("/history/events", {"from": read_moment(start), "to": read_moment(end), "kind": kind}, read_page)

    def history(
        self, address: str, *, start: Moment | None = None, end: Moment | None = None, bucket: str | None = None
    ) -> Iterator[dict[str, Any]]:
        """The values of an address that the gateway kept, oldest first, such as ``{"time": "2026-11-25T06:00:00.031250Z",
        "value": 12.5}``: a value counts until the next sample. Without a value, ``["value"]`` is ``None`` and ``["gap"]``
        says why. ``start`` and ``end``: a ``datetime`` with its time zone, or RFC 3339 in UTC; without them, the last
        hour. The first sample is the last one before ``start``, if it counts there.

        With ``bucket``, such as ``"10s"`` or ``"1m"``, each has ``["mean"]`` (weighted by time), ``["min"]``, ``["max"]``,
        ``["last"]``, ``["good_ms"]`` and the number of ``["samples"]`` of a span of this width.

        Each page of 10000 is one request, made when the loop comes to it. A ``RuntimeWarning`` says if samples are
        missing because the disk of the gateway cannot be read. ``InvalidRequest`` if the address is wrong.
        """
        of_time = {"from": read_moment(start), "to": read_moment(end)}
        asked = {"signal": address, **of_time, "bucket": bucket, "limit": "10000"}
        return self._pages("/history", asked, read_history)

    def production(
        self,
        *,
        start: Moment | None = None,
        end: Moment | None = None,
        shift: str | None = None,
        date: str | None = None,
        by_shift: bool = False,
    ) -> dict[str, Any]:
        """The figures of production from ``start`` to ``end``, each a ``datetime`` with its time zone or RFC 3339 in UTC,
        at most 31 days; without them, the last day. Times are in milliseconds. What was not seen is ``unseen_ms``, and in no state.

        With ``shift`` and ``date``, such as ``"night"`` and ``"2026-11-25"``, those of this shift. With
        ``by_shift``, ``["shifts"]`` has those of each shift that begins in the range.
        """
        asked = {"from": read_moment(start), "to": read_moment(end), "shift": shift, "date": date, "by": "shift" if by_shift else None}
        query = urlencode({name: value for name, value in asked.items() if value is not None})
        return self._ask("GET", f"/production?{query}", dict)

    def alarms(self, *, active: bool = False) -> list[dict[str, Any]]:
        """The alarms of this robot, as ``Gateway.alarms`` has them: the active one, and those that ended within a
        day, at most 30."""
        return self._ask("GET", f"/alarms?{urlencode({'active': json.dumps(active), 'limit': 1000})}", read_alarms)

    def acknowledge(self, alarm: int, comment: str | None = None) -> dict[str, Any]:
        """Says that somebody saw the alarm with this ``["id"]``, and returns the alarm. It changes nothing at the
        robot and needs no lease. The first to acknowledge an alarm stays. Operators only.

        ``InvalidRequest`` with the reason ``no_such_alarm``: the robot has no such alarm, or it ended long ago.
        """
        body = {} if comment is None else {"comment": comment}
        return self._ask("POST", f"/alarms/{int(alarm)}/acknowledge", read_alarm, body, "changes")

    def shelve(self, alarm: int, duration: float, reason: str) -> dict[str, Any]:
        """Shelves the alarms of this one's code at this robot for ``duration`` seconds, 1 to 28800, also those that
        come later: they need no answer. It changes nothing at the robot and needs no lease. Engineers only."""
        body = {"for_ms": round(duration * 1000), "reason": reason}
        return self._ask("POST", f"/alarms/{int(alarm)}/shelve", read_alarm, body, "changes")

    def unshelve(self, alarm: int) -> dict[str, Any]:
        """Takes the alarms of this one's code from the shelf. Engineers only."""
        return self._ask("DELETE", f"/alarms/{int(alarm)}/shelve", read_alarm, None, "changes")

    def add_points(self, camera: int, points: Sequence[Point]) -> int | None:
        """Sends the parts that a camera found, and returns how many the controller says it took; ``None`` if it does
        not say. It needs no lease, but a token with the grant for this camera (``r6 gateway token --camera``).
        That the controller took them does not mean that the arm moves. They are never sent again.
        """
        found = [{name: value for name, value in asdict(point).items() if value is not None} for point in points]
        return self._ask("POST", f"/cameras/{int(camera)}/points", read_taken, {"points": found}, "moves")

    def answer_photo(self, camera: int, taken: bool = True) -> None:
        """Answers a photo that the controller asks for: the event ``photo_requested`` of ``Gateway.events``. It needs
        the grant for this camera. Controllers do not reply to this: it returns when the answer left.
        """
        self._ask("POST", f"/cameras/{int(camera)}/photo", read_nothing, {"taken": bool(taken)}, "moves")

    def run(self, number: int) -> GatewayRun:
        """A run of a program, from its number. The gateway keeps it for 24 h. To begin one: ``GatewayLease.run``."""
        return self._ask("GET", f"/runs/{number}", lambda data: GatewayRun(self, None, data))

    def runs(self) -> Iterator[GatewayRun]:
        """The runs of programs, the newest first: to find one whose answer was lost, for example. They are kept for 24 h,
        and go when the next one begins. Each page of 100 is one request, made when the loop comes to it."""
        before: int | None = None
        while True:
            query = "" if before is None else f"?{urlencode({'before': before})}"
            runs, before = self._ask("GET", f"/runs{query}", partial(self._read_runs, before))
            yield from runs
            if before is None:
                return

    def _read_runs(self, before: int | None, answer: Any) -> tuple[list[GatewayRun], int | None]:
        """The runs of a page, and before which number the next one begins."""
        runs, more = [GatewayRun(self, None, dict(run)) for run in answer["runs"]], answer["next_before"]
        more = None if more is None else int(more)
        if before is not None and more is not None and more >= before:
            raise ValueError("a page that leads back")
        return runs, more

    def stop(self) -> float:
        """Stops the robot, and returns the seconds until it was proved that the arm stands. It needs no lease.
        The stop holds until ``GatewayLease.clear_stopped``.

        ``OutcomeUnknown`` with the reason ``not_stopped``: it is not proved. Use the emergency stop.
        """
        return self._ask("POST", "/stop", read_took, effect="stops")

    def stop_command(self, word: Literal["actionStop", "actionPause", "stopButton"]) -> None:
        """Sends one command that stops or pauses. It needs no lease and holds as ``stop`` does, but does not
        prove that the arm stands."""
        self._ask("POST", "/commands", read_after, {"command": word}, "stops")

    def panel(self) -> dict[str, Any]:
        """What a person at the machine sees: mode, alarm, inputs, axes, program. Twins (``r6 gateway --twins``) and
        the robot of ``r6 up`` have a panel.

        ``InvalidRequest`` with the reason ``no_panel``: this robot has none.
        """
        return self._ask("GET", "/panel", dict)

    def panel_stop(self, button: Literal["stop", "pause", "emergency_stop"]) -> dict[str, Any]:
        """Presses this button of a virtual robot's panel, and returns what a person then sees. It needs no lease
        and holds as ``stop`` does, but does not prove that the arm stands."""
        action = {"do": button} if button == "emergency_stop" else {"do": "press", "button": button}
        return self._ask("POST", "/panel", lambda done: dict(done["panel"]), {"action": action}, "stops")

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
        self._ask("POST", "/accept-identity", read_nothing, found, "changes")

    def _ask(
        self,
        method: str,
        path: str,
        read: Callable[[Any], T],
        body: Mapping[str, Any] | None = None,
        effect: Effect = "reads",
        headers: Mapping[str, str] | None = None,
    ) -> T:
        return self._http.ask(method, self._path(path), read, body, effect, headers)

    def _pages(
        self,
        path: str,
        asked: dict[str, str | None],
        read: Callable[[Any], tuple[list[dict[str, Any]], dict[str, str] | None]],
    ) -> Iterator[dict[str, Any]]:
        """What all pages have. Each is asked for when the loop comes to it."""
        passed: set[str] = set()
        while True:
            query = urlencode({name: value for name, value in asked.items() if value is not None})
            rows, more = self._ask("GET", f"{path}?{query}", read)
            if more is not None and more["cursor"] in passed:
                raise self._http.unclear("GET", self._path(path), "reads", "a page that leads back to itself")
            yield from rows
            if more is None:
                return
            passed.add(more["cursor"])
            asked |= more

    def _path(self, path: str) -> str:
        return f"/v1/robots/{quote(self.name, safe='')}{path}"


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
        self._robot._ask("DELETE", "/lease", read_nothing, {"lease": self._key}, "changes")

    def command(self, word: str, *arguments: object, run_leftover: bool = False, key: str | None = None) -> float:
        """Sends a command, in the words and units of ``r6 command``: ``lease.command("modifyGSPD", 20)``. Returns the
        seconds until the controller accepted it. That does not mean that the arm moves.

        ``run_leftover``: send a command that starts the machine even if instructions are left in its list.
        ``key``: the ``Idempotency-Key``. The gateway sends a command with it once: a second call with the same key
        and arguments within 24 h gets the answer of the first one. Without it, each call has a new one. If no answer
        comes, the gateway is asked again with the same key, within the ``timeout`` of ``Gateway``.

        ``ValueError`` says which word or argument is wrong; nothing is sent then. ``OutcomeUnknown``: look at
        the robot before anything is sent again, or call again with the same ``key``.
        """
        Command.typed(word, *arguments)
        texts = [str(int(argument)) if isinstance(argument, bool) else str(argument) for argument in arguments]
        body = {"command": word, "arguments": texts, "lease": self._key, "run_leftover": run_leftover}
        key = str(uuid.uuid4()) if key is None else key
        return self._robot._http.ask_once(self._robot._path("/commands"), read_after, body, "moves", key)

    def run(
        self,
        program: str | None = None,
        *,
        name: str | None = None,
        version: int | None = None,
        sha256: str | None = None,
        repeat: int = 1,
        key: str | None = None,
    ) -> GatewayRun:
        """Runs a program on the robot. Give either ``program``, its text, or the ``name`` of a program that
        the gateway keeps (``Gateway.programs``); without ``version``, the latest one. It runs ``repeat``
        times. Returns once the controller accepted the first list; ``GatewayRun.wait`` waits for the end. The
        arm is stopped if the lease ends.

        ``sha256``: that of the text which a person looked at, ``GatewayProgram.sha256``. If the text to run
        is another one, nothing is sent (``NotSent`` with the reason ``other_text``).

        ``key``: the ``Idempotency-Key``. A second call with the same key and the same arguments gets the same
        run, and moves nothing. Without it, each call has a new one.

        ``InvalidRequest`` if the program has mistakes (``reason`` is ``"bad_program"``); ``NotSent`` if the robot
        is not ready; ``OutcomeUnknown``: look at the robot, or call again with the same ``key``.
        """
        asked: dict[str, Any] = {"program": program, "name": name, "version": version, "sha256": sha256}
        body = {word: value for word, value in asked.items() if value is not None}
        body |= {"lease": self._key, "repeat": repeat}
        headers = {"Idempotency-Key": header(str(uuid.uuid4()) if key is None else key, "Idempotency-Key")}
        return self._robot._ask(
            "POST",
            "/programs/run",
            lambda data: GatewayRun(self._robot, self, data),
            body,
            "moves",
            headers,
        )

    def panel(self, do: str, *, run_leftover: bool = False, **fields: object) -> dict[str, Any]:
        """Does what a person does at the machine, and returns what the person then sees:
        ``lease.panel("press", button="start")``, ``lease.panel("turn_key", key="manual")``,
        ``lease.panel("jog", axis="J1", by=10)``. The words are those of the panel's HTTP API. A move has begun
        then, not ended. For a stop, see ``GatewayRobot.panel_stop``.

        ``run_leftover``: start even if instructions are left in the list. ``NotSent``: it was not done, and
        ``reason`` says why, such as ``not_manual``. ``InvalidRequest`` with the reason ``no_panel``: this robot has no panel.
        """
        body = {"action": {"do": do, **fields}, "lease": self._key, "run_leftover": run_leftover}
        return self._robot._ask("POST", "/panel", lambda done: dict(done["panel"]), body, "moves")

    def clear_stopped(self) -> None:
        """Lets the robot move again after a stop. Look at the robot first."""
        self._robot._ask("POST", "/clear-stopped", read_nothing, {"lease": self._key}, "changes")
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
