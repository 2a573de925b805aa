"""A hall's robots over the gateway (``r6 gateway``): ``Gateway``. It needs no connection to a robot."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from ._gateway_http import UNREADABLE, HttpClient, not_sent
from ._gateway_robot import GatewayRobot
from ._gateway_values import (
    Changes,
    Events,
    GatewayChange,
    GatewayEvent,
    GatewayState,
    read_alarms,
    read_not_known,
    read_signals,
)


class Gateway:
    """A gateway. It holds no connection: each call makes its own, so it can be used from several threads.

    Errors are those of ``Robot``; ``reason`` is the code of the gateway's problem (``"leased"``,
    ``"not_allowed"``, …). No request is sent twice, except a command of which no answer came: the gateway
    knows it by its ``Idempotency-Key``, and sends it to the robot once.

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
        self._http = HttpClient(
            url,
            token=token,
            token_file=token_file,
            ca_file=ca_file,
            insecure_http=insecure_http,
            timeout=timeout,
        )

    def __repr__(self) -> str:
        return repr(self._http)

    def robots(self) -> list[GatewayState]:
        """All robots that the token may see, without their values."""
        return self._http.ask("GET", "/v1/robots", lambda answer: [GatewayState._of(data) for data in answer["robots"]])

    def robot(self, name: str) -> GatewayRobot:
        """The handle of a robot. Nothing is sent yet."""
        return GatewayRobot(self._http, name)

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
        for number, kind, data in self._http.stream("/v1/live", asked, after):
            try:
                name = data["name" if kind == "snapshot" else "robot"]
                change = GatewayChange(name, kind, read_signals(data), number)
            except UNREADABLE as error:
                raise self._http.unclear("GET", "/v1/live", "reads", f"a {kind} that cannot be read") from error
            yield change

    def events(self, *, robot: str | None = None, after: str | None = None) -> Events:
        """What happens from now on, or behind the event with the id ``after``: links, leases, stops, commands.

        Errors as for ``live``.
        """
        for number, kind, data in self._http.stream("/v1/events", {"robot": robot}, after):
            happened = data.get("event", kind)
            yield GatewayEvent(number, happened, data.get("robot"), data.get("time"), data)

    def alarms(self, *, active: bool = False, partial: bool = False) -> list[dict[str, Any]]:
        """The alarms of all robots that the token may see: the active ones first, then those that ended within a
        day, the latest first, at most 1000. With ``active`` only those that have not ended. ``["acknowledged"]``
        and ``["shelved"]`` say by whom, or are ``None``.

        Where several gateways share a store, those of some robots may not be known: ``NotSent`` with the reason
        ``no_owner`` names them. With ``partial`` the alarms of the others are returned.
        """
        path = f"/v1/alarms?{urlencode({'active': json.dumps(active), 'limit': 1000})}"
        alarms, missing = self._http.ask("GET", path, lambda answer: (read_alarms(answer), read_not_known(answer)))
        if missing and not partial:
            text = f"the alarms of {', '.join(missing)} are not known now: no gateway answers for them. Ask again, "
            raise not_sent("no_owner", text + "or take those of the other robots with partial=True")
        return alarms

    def audit(self, *, after: int = 0, limit: int = 100) -> list[dict[str, Any]]:
        """Entries of the audit log behind a number, oldest first, at most 1000. Engineers only."""
        path = f"/v1/audit?{urlencode({'after': after, 'limit': limit})}"
        return self._http.ask("GET", path, lambda answer: list(answer["entries"]))

    def check(self, program: str) -> dict[str, Any]:
        """The mistakes of the text of a program (the first 20, and how many more), and where each step can run: what ``POST /v1/programs/check``
        answers. ``["ok"]`` says whether there is no mistake. Nothing is sent to a robot.
        """
        return self._http.ask("POST", "/v1/programs/check", dict, {"program": program})

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
        return self._http.ask("POST", "/v1/programs/plan", dict, given)
