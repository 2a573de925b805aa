"""A hall's robots over the gateway (``r6 gateway``): ``Gateway``. It needs no connection to a robot."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode

from ._errors import OutcomeUnknown
from ._gateway_http import UNREADABLE, HttpClient, not_sent
from ._gateway_library import (
    GatewayPoint,
    GatewayProgram,
    if_match,
    read_point,
    read_point_versions,
    read_points,
    read_program,
    read_program_versions,
    read_programs,
    read_stored_program,
    sha256_of,
)
from ._gateway_robot import GatewayRobot
from ._gateway_values import (
    Changes,
    Events,
    GatewayChange,
    GatewayEvent,
    GatewayState,
    read_alarms,
    read_not_known,
    read_nothing,
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
        """The mistakes of the text of a program (the first 20, and how many more), and where each step can
        run: what ``POST /v1/programs/check`` answers. ``["ok"]`` says whether there is no mistake. Nothing is
        sent to a robot.
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

    def programs(self) -> list[GatewayProgram]:
        """The programs that the gateway keeps, in the order of their names: each in its latest version,
        without its text. At most 1000."""
        return self._http.ask("GET", "/v1/programs", read_programs)

    def program(self, name: str, version: int | None = None) -> GatewayProgram:
        """A program that the gateway keeps, with its text: the latest version, or the one with this number.
        The text is checked against ``sha256``.

        ``InvalidRequest`` with the reason ``no_such_program``: there is no such program, or not this version.
        """
        read = partial(read_program, name=name, version=version)
        return self._http.ask("GET", _path("programs", name, version), read)

    def program_versions(self, name: str) -> list[GatewayProgram]:
        """The last 50 versions of a program, the latest first, without their texts. Errors as for
        ``program``."""
        read = partial(read_program_versions, name=name)
        return self._http.ask("GET", f"{_path('programs', name)}/versions", read)

    def store_program(
        self, name: str, program: str, *, expected: GatewayProgram | str | None = None
    ) -> GatewayProgram:
        """Stores a text as the next version of a program, with mistakes too: look at ``ok``. Nothing is sent
        to a robot. Engineers only, with a token for all robots.

        ``name``: 1 to 64 characters of a to z, digits, ``-`` and ``_``. ``program``: at most 256 KiB.
        ``expected``: the version that the change began from, or its ``etag``. The text is stored only while
        that is the latest version, so that it replaces nothing that the caller has not seen. Without
        ``expected`` only a new name is stored.

        ``InvalidRequest`` with the reason ``needs_if_match``: the name is in use: read the program and pass
        it as ``expected``. ``NotSent`` with the reason ``not_this_version``: it was changed or removed
        meanwhile: read it again, and look at what changed; ``no_room``: remove other programs first.
        ``OutcomeUnknown``: it may have been stored: look at ``program_versions``.
        """
        sha256_of(program)
        read = partial(read_stored_program, name=name, text=program)
        headers = if_match(name, expected)
        return self._http.ask("PUT", _path("programs", name), read, {"program": program}, "changes", headers)

    def remove_program(self, name: str, *, expected: GatewayProgram | str) -> None:
        """Removes a program with all of its versions, if ``expected`` is its latest version, or the ``etag``
        of it. Engineers only, with a token for all robots.

        ``NotSent`` with the reason ``not_this_version``: it was changed meanwhile. ``InvalidRequest`` with
        the reason ``no_such_program``: it is not there. ``OutcomeUnknown``: look at ``programs``.
        """
        headers = if_match(name, expected)
        self._http.ask("DELETE", _path("programs", name), read_nothing, None, "changes", headers)

    def points(self) -> list[GatewayPoint]:
        """The points that the gateway keeps, in the order of their names, each in its latest version. At most
        1000."""
        return self._http.ask("GET", "/v1/points", read_points)

    def point(self, name: str, version: int | None = None) -> GatewayPoint:
        """A point that the gateway keeps: the latest version, or the one with this number.

        ``InvalidRequest`` with the reason ``no_such_point``: there is no such point, or not this version.
        """
        return self._http.ask("GET", _path("points", name, version), partial(read_point, name=name, version=version))

    def point_versions(self, name: str) -> list[GatewayPoint]:
        """The last 50 versions of a point, the latest first. Errors as for ``point``."""
        return self._http.ask("GET", f"{_path('points', name)}/versions", partial(read_point_versions, name=name))

    def store_point(
        self,
        name: str,
        *,
        robot: str | None = None,
        axes: Sequence[float] | None = None,
        pose: Sequence[float] | None = None,
        tool: int | None = None,
        work_frame: int | None = None,
        note: str = "",
        expected: GatewayPoint | str | None = None,
    ) -> GatewayPoint:
        """Stores a place of an arm as the next version of a point. Nothing moves. Engineers only, with a
        token for all robots.

        ``axes``: 1 to 8 positions, J1 first, degrees, or mm of a sliding axis. ``pose``: X, Y, Z in mm; U, V,
        W in degrees; ``tool`` and ``work_frame``: what it is of. With ``robot`` alone it is where that robot
        stands now. ``note``: at most 200 bytes. ``name`` and ``expected`` as for ``store_program``, as are
        ``needs_if_match``, ``not_this_version``, ``no_room`` and ``OutcomeUnknown``.

        ``NotSent`` with the reason ``not_ready`` or ``no_reply``: the robot does not answer, or moves:
        nothing was stored. ``InvalidRequest`` with the reason ``bad_value``: a number or the note is wrong.
        ``ValueError`` for a number that is not finite.
        """
        asked: dict[str, Any] = {"robot": robot, "tool": tool, "work_frame": work_frame, "note": note or None}
        for word, numbers in (("axes", axes), ("pose", pose)):
            asked[word] = None if numbers is None else [float(number) for number in numbers]
        body = {word: value for word, value in asked.items() if value is not None}
        read = partial(read_point, name=name)
        try:
            return self._http.ask("PUT", _path("points", name), read, body, "changes", if_match(name, expected))
        except OutcomeUnknown as unknown:
            # The robot was asked where it stands, and nothing more.
            if unknown.reason != "no_reply":
                raise
            raise not_sent("no_reply", f"nothing was stored: {unknown}") from unknown

    def remove_point(self, name: str, *, expected: GatewayPoint | str) -> None:
        """Removes a point with all of its versions, as ``remove_program`` does a program
        (``no_such_point``)."""
        headers = if_match(name, expected)
        self._http.ask("DELETE", _path("points", name), read_nothing, None, "changes", headers)


def _path(shelf: str, name: str, version: int | None = None) -> str:
    """The path of a program or a point, or of one of its versions."""
    query = "" if version is None else f"?{urlencode({'version': int(version)})}"
    return f"/v1/{shelf}/{quote(name, safe='')}{query}"
