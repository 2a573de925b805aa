"""What a gateway tells: values, states, changes and events, read from its JSON."""

from __future__ import annotations

import warnings
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from typing import Any

from ._errors import NoReading


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
        return cls(data["name"], data["link"] == "up", data["stopped"], holder, read_signals(data), data)


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


Moment = str | datetime
"""A time: a ``datetime`` with its time zone, or RFC 3339 in UTC."""


def read_moment(moment: Moment | None) -> str | None:
    """The moment as a gateway reads it: RFC 3339 in UTC."""
    if not isinstance(moment, datetime):
        return moment
    if moment.utcoffset() is None:
        raise ValueError(f"{moment!r} has no time zone: use datetime.now(timezone.utc), or name a tzinfo")
    return moment.astimezone(timezone.utc).isoformat().replace("+00:00", "Z")


def read_signals(data: Mapping[str, Any]) -> dict[str, GatewaySignal]:
    signals = [GatewaySignal._of(signal) for signal in data.get("signals", [])]
    return {signal.address: signal for signal in signals}


def read_took(answer: Any) -> float:
    """The seconds of a stop that is proved."""
    if answer["confirmed"] is not True:
        raise ValueError("the stop is not confirmed")
    return float(answer["took_ms"]) / 1000


def read_taken(answer: Any) -> int | None:
    """How many points the controller says it took."""
    return None if answer["taken"] is None else int(answer["taken"])


def read_after(answer: Any) -> float:
    """The seconds until the controller accepted a command."""
    return float(answer["after_ms"]) / 1000


def read_page(answer: Any) -> tuple[list[dict[str, Any]], dict[str, str] | None]:
    """The events of a page, and how to ask for the next one."""
    return [dict(event) for event in answer["events"]], _next_page(answer)


def read_history(answer: Any) -> tuple[list[dict[str, Any]], dict[str, str] | None]:
    """The samples or buckets of a page, and how to ask for the next one."""
    chunks = int(answer["unreadable_chunks"])
    if chunks > 0:
        what = f"{chunks} chunks of {answer['signal']} cannot be read at the gateway: their samples are missing"
        warnings.warn(what, RuntimeWarning, stacklevel=2)
    # A gateway of an older r6 keeps none.
    for part in answer.get("averages", []):
        if part["used"] == "not_used":
            width, begin, end = int(part["width_ms"]) // 1000, part["from"], part["to"]
            what = f"the gateway has only averages of {width} s from {begin} to {end}: ask for such buckets"
            warnings.warn(what, RuntimeWarning, stacklevel=2)
        elif part["used"] == "incomplete":
            what = f"the averages from {part['from']} to {part['to']} lack some values: they came late or are lost"
            warnings.warn(what, RuntimeWarning, stacklevel=2)
    rows = answer["buckets"] if "buckets" in answer else answer["samples"]
    return [dict(row) for row in rows], _next_page(answer)


def _next_page(answer: Any) -> dict[str, str] | None:
    """How to ask for the next page: the range of the first one stays."""
    cursor = answer["next_cursor"]
    if cursor is None:
        return None
    return {"from": str(answer["from"]), "to": str(answer["to"]), "cursor": str(cursor)}


def read_alarm(answer: Any) -> dict[str, Any]:
    """An alarm. What the caller decides by has to be there."""
    if not {"id", "code", "state", "acknowledged", "shelved"} <= set(answer):
        raise ValueError("an alarm without its state")
    return dict(answer)


def read_alarms(answer: Any) -> list[dict[str, Any]]:
    return [read_alarm(alarm) for alarm in answer["alarms"]]


def read_not_known(answer: Any) -> list[str]:
    """The robots whose alarms are not in an answer. A gateway of an older r6 does not name them."""
    return [str(robot) for robot in answer.get("not_known", [])]


def read_nothing(answer: Any) -> None:
    """Nothing: the answer has no body."""
    if answer is not None:
        raise ValueError("an answer with a body where none was expected")
