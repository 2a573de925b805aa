"""Values that are read from a robot. Times are seconds, lengths mm, angles degrees; positions are float64
arrays."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Literal, TypeAlias, Union

import numpy as np
import numpy.typing as npt

from ._errors import NoReading, RequestError

Floats: TypeAlias = npt.NDArray[np.float64]
"""An array of float64."""

Integers: TypeAlias = npt.NDArray[np.int64]
"""An array of int64."""

StepState: TypeAlias = Literal["queued", "sent", "running", "done", "lost"]
"""What has become of a step: not sent yet (or never, once the motion has ended); in the controller's list; its turn has
come; over; left and not seen to be over when the streaming ended."""

Quality: TypeAlias = Literal["fresh", "stale", "dead", "not_read", "unsupported", "unreadable"]
"""What a value is worth: act on ``fresh`` ones alone."""

Wait: TypeAlias = Literal["on", "off", "rising", "falling"]
"""For what a step of a motion waits."""


class OperationMode(IntEnum):
    """``curMode``. A controller may send another number, so modes are plain ``int`` everywhere."""

    NONE = 0
    MANUAL = 1
    """The pendant has the arm."""
    AUTO = 2
    """Automatic, not running."""
    STOP = 3
    RUNNING = 7
    """The program runs; instructions are taken while it sits in its wait step."""
    SINGLE_STEP = 8
    SINGLE_CYCLE = 9


@dataclass(frozen=True)
class Counter:
    """A counter of the controller."""

    id: int
    target: int
    """The count it goes to."""
    current: int
    """The count it has."""
    name: str | None
    """Only older firmware tells it."""


Reading: TypeAlias = Union[str, int, float, bool, "list[str]", Counter]
"""The value of an address: text, whole number, decimal number in the unit of its address, 32 points as an ``int`` (bit 0
is the first), flag, list of texts, or counter."""


class QueryResult(Mapping[str, Reading]):
    """The values of some addresses, under the names of the query. It has only addresses with a value.

    Values that took several frames to read are not from the same instant.
    """

    __slots__ = ("_values", "missing", "took")

    missing: dict[str, str]
    """The addresses without a value, and why."""
    took: float
    """How long the slowest reply took, seconds."""

    def __init__(self, values: dict[str, Reading], missing: dict[str, str], took: float) -> None:
        self._values = values
        self.missing = missing
        self.took = took

    def __getitem__(self, address: str) -> Reading:
        """The value; ``NoReading`` if there is no value or it was not asked for."""
        try:
            return self._values[address]
        except KeyError:
            why = self.missing.get(address, "it was not asked for")
            raise NoReading(f"{address}: {why}") from None

    def __contains__(self, address: object) -> bool:
        return address in self._values

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def get(self, address: str, default: Any = None) -> Any:
        """The value, or the default if there is no value."""
        return self._values.get(address, default)

    def number(self, address: str) -> float:
        """A number, in the unit of its address; ``NoReading`` if there is no number."""
        value = self[address]
        if isinstance(value, (int, float)):
            return float(value)
        raise NoReading(f"{address}: {value!r} is no number")

    def integer(self, address: str) -> int:
        """A whole number, 32 points, or a flag as 0 and 1; ``NoReading`` if there is no such value."""
        value = self[address]
        if isinstance(value, int):
            return int(value)
        raise NoReading(f"{address}: {value!r} is no whole number")

    def text(self, address: str) -> str:
        """A text; ``NoReading`` if there is no text."""
        value = self[address]
        if isinstance(value, str):
            return value
        raise NoReading(f"{address}: {value!r} is no text")

    def array(self, *addresses: str) -> Floats:
        """The numbers of these addresses, in order: shape (n,), NaN for a missing number."""
        return np.array([_number(self._values.get(address)) for address in addresses], np.float64)

    def __repr__(self) -> str:
        return f"QueryResult({self._values!r}, missing={self.missing!r})"


def _number(reading: Reading | None) -> float:
    return float(reading) if isinstance(reading, (int, float)) else float("nan")


@dataclass(frozen=True)
class Unmet:
    """An unmet condition for sending instructions. As text it says what to do."""

    kind: Literal["mode", "alarm", "not_homed", "moving", "leftover_list", "unknown"]
    value: int | None
    """The mode, the alarm, or how many instructions are left."""
    address: str | None
    """The address that cannot be read."""
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, eq=False)
class Status:
    """The state of a machine. ``None`` if the controller has no such value or sent one that cannot be
    read."""

    firmware: str | None
    machine_name: str | None
    program: str | None
    """Only the pendant's port tells."""
    mode: int | None
    """See ``OperationMode``."""
    alarm: int | None
    """0 for none; ``r6.alarm`` says what it means."""
    homed: bool | None
    moving: bool | None
    axis_count: int | None
    axes: Floats
    """J1 to J6: shape (6,), degrees, or mm where an axis slides, which no address tells; NaN where not known."""
    pose: Floats
    """X, Y, Z, U, V, W: shape (6,), mm and degrees, NaN where not known."""
    list_length: int | None
    """Instructions left in the instruction list; older firmware cannot tell."""
    cycle: float | None
    """Time of the present cycle, seconds."""
    last_cycle: float | None
    """Time of the last cycle, seconds."""
    unmet: tuple[Unmet, ...]
    """What keeps the machine from taking instructions, in the order in which it is to be dealt with."""
    unproved: tuple[Literal["remote_step", "list_length"], ...]
    """What has to hold, and no value tells: whether the program sits in its step that waits for remote commands, which no firmware tells;
    how many instructions are left in the list, which older firmware does not tell."""
    _told: str = field(default="", repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The output of ``r6 status --json`` (without ``--remote-program``) and of the panel, for
        ``json.dumps``. The keys are in docs/COMMAND_LINE.md. It shows what was read, even if fields of
        this object were replaced since.

        Errors: ``ValueError`` for a status that was not read from a robot.
        """
        if not self._told:
            raise ValueError("only a status that was read from a robot has this form")
        told: dict[str, Any] = json.loads(self._told)
        return told

    @property
    def is_ready(self) -> bool:
        """Whether no readable value keeps the machine from taking instructions. It does not prove that the
        machine takes them: see ``unproved``."""
        return not self.unmet


@dataclass(frozen=True, eq=False)
class Done:
    """The arm stands without alarm, and its list is done as far as the controller reports."""

    axes: Floats
    """J1 to J6: shape (6,), degrees, or mm where an axis slides, which no address tells; NaN where not known."""
    pose: Floats
    """X, Y, Z, U, V, W: shape (6,), mm and degrees, NaN where not known."""
    mode: int | None
    moved: bool
    """Whether a look saw the arm move, or a list that was not empty."""
    motion: int | None
    """The number of the motion (``MotionHandle.number``); ``None`` where none of this robot's motions was waited for."""
    proof: Literal["reached", "consumed", "cut_short", "at_rest"]
    """What proves the end: the arm stands where the last move ends; the controller was seen to work through its list; an input
    cut the last move short; or the arm stands with an empty list, and where it should stand is not known."""
    cut_short: str | None
    """Where the arm should have been, where an input cut its last move short."""
    took: float
    """Seconds from the first read on."""


@dataclass(frozen=True, eq=False)
class Followed:
    """A target was followed to the end, and the arm stands."""

    steps: int
    """Steps that were made."""
    axes: Floats
    """J1 to J6: shape (6,), degrees, or mm where an axis slides, which no address tells; NaN where not known."""
    behind: float | None
    """How far the farthest axis is from the last target that was told, degrees; mm where it slides. ``None`` where no target was
    told, or it is not known where an axis is."""


@dataclass(frozen=True)
class Accepted:
    """The controller accepted the request. This does not mean that the arm moves."""

    after: float
    """How long the reply took, seconds."""
    points: int | None
    """How many points were taken; only ``add_points`` tells."""


@dataclass(frozen=True)
class StopReport:
    """The result of a stop. As text it says the result."""

    confirmed: bool
    """Whether it is proved that the arm stands. If not, use the emergency stop."""
    proof: Literal["not_running", "empty_list"] | None
    """What proves it: a mode in which no program runs; or, where ``RobotSettings.stays_in_mode_7`` is set, a long rest with an empty
    list (a taught program may still run)."""
    means: str | None
    """The last means that left before that: ``actionStop``, ``stopButton``, ``actionPause``, or ``AddRCC`` (an empty list)."""
    second_connection: Literal["used", "answered", "silent", "opening", "not_made", "unidentified"] | None
    """What became of a second connection; ``None`` if the first answer was not late."""
    in_doubt: bool | None
    """Whether a frame that can move the arm is still unanswered; ``None`` if there was none when the stop began."""
    attempts: int
    """How many stops were sent."""
    took: float
    """Seconds until the standstill was proved, or was given up."""
    robot: Identity | None
    """Who was stopped; ``None`` if it did not say who it is."""
    connection: int
    """The number of the connection that the standstill was read over; a second connection counts its own."""
    moving: bool | None
    mode: int | None
    alarm: int | None
    """42 after a stop is usual on some firmware."""
    list_length: int | None
    list: Literal["was_empty", "cleared", "refused", "unknown", "not_tried"]
    """What became of the instructions that were left: what is not cleared may run at the next start."""
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Latency:
    """How long recent replies took, seconds: at most 1024 of the last minute."""

    count: int
    p50: float
    p90: float
    p99: float
    max: float


@dataclass(frozen=True)
class LinkQuality:
    """The quality of the connection; counts since ``connect``, over all connections."""

    state: Literal["alive", "unknown", "suspect", "dead"]
    """Only a reply says that a controller lives; an open socket proves nothing."""
    latency: Latency | None
    """``None`` if there was no reply in the last minute."""
    requests: int
    replies: int
    timeouts: int
    lost: int
    """Requests whose connection ended before their reply."""
    strays: int
    """Frames that answered nothing."""
    garbled: int
    """Bytes that were no frame, and frames that were no JSON."""
    reconnects: int
    last_reply: float | None
    """How long ago the last reply came, seconds."""
    silent_for: float | None
    """How long something was asked without any reply, or the connection is gone, seconds."""


@dataclass(frozen=True)
class Identity:
    """The identity that a controller reports. The wire has no serial number."""

    firmware: str | None
    machine_name: str | None
    axis_count: int | None


@dataclass(frozen=True)
class Mistake:
    """One mistake of a file written by a person."""

    line: int | None
    """Counted from 1; ``None`` if the whole file is meant."""
    column: int | None
    """Counted from 1, in characters."""
    what: str
    """What is wrong there."""
    advice: str | None
    """What to do about it."""


@dataclass(frozen=True)
class Discovered:
    """The result of the search at one address."""

    address: str
    """As it was given."""
    who: Identity | RequestError
    """Who answered, or why nobody did."""


@dataclass(frozen=True)
class Photo:
    """The controller asks for a photo: answer it with ``answer_photo``."""

    cam_id: int


@dataclass(frozen=True)
class PhotosEnded:
    """Why photos are no longer served. As text it says what to do."""

    reason: Literal["connection_lost", "stopped", "closed", "served_already", "request", "fell_behind"]
    """``connection_lost``: requests reach nobody; look at the machine (``Robot.status`` connects anew), then serve again.
    ``stopped``: a handle of this connection sent a stop or a pause while a picture was under way, and its points are held
    back; look at the machine, then serve again. ``closed``: the robot was closed. ``served_already``: another call serves the
    photos of this connection, and nothing was sent. ``request``: an answer did not leave, the points were not taken, or they
    cannot be sent, and then the request got no answer. ``fell_behind``: events were missed, and requests may be among them; serve again."""
    cam_id: int | None
    """The camera whose request failed."""
    error: RequestError | None
    """Why it failed."""
    missed: int | None
    """How many events were missed."""
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Stray:
    """A frame that does not answer any waiting request."""

    text: str
    frame: bytes
    """Cut at 4096."""


@dataclass(frozen=True)
class Garbled:
    """Bytes that are no frame, or a frame that is no JSON."""

    text: str


@dataclass(frozen=True)
class ConnectionLost:
    """The connection ended. A query or a stop reconnects."""

    text: str


@dataclass(frozen=True)
class Reconnected:
    """The client has reconnected, and has read the controller's identity and state."""

    identity: Identity
    another: bool
    """Whether that is another robot than before: no command leaves until ``accept_identity``."""
    mode: int | None
    alarm: int | None
    list_length: int | None


@dataclass(frozen=True)
class Missed:
    """Events that were dropped because they were not read in time."""

    count: int


Event: TypeAlias = Union[Photo, Stray, Garbled, ConnectionLost, Reconnected, Missed]
"""What happens on a connection without being asked for."""


@dataclass(frozen=True)
class Value:
    """The last value of an address, and its quality."""

    address: str
    reading: Reading | None
    age: float | None
    """How long ago it was asked for, seconds: it is no older. ``None`` if no answer ever came."""
    quality: Quality
    problem: str | None
    """What is wrong with an ``unreadable`` value."""


@dataclass(frozen=True)
class Snapshot:
    """The values of a subscription at one moment, in the order of its addresses. Each value has its own
    age."""

    values: tuple[Value, ...]
    failure: RequestError | None
    """Why the last poll failed; ``None`` if it did not."""

    def __getitem__(self, address: str) -> Value:
        """The value of an address; ``KeyError`` if it was not subscribed to."""
        for value in self.values:
            if value.address == address:
                return value
        raise KeyError(address)

    def fresh(self, address: str) -> Reading | None:
        """The reading if it is fresh. Act only on fresh values."""
        value = self[address]
        return value.reading if value.quality == "fresh" else None

    def array(self) -> Floats:
        """The fresh numbers, in the order of the addresses: shape (n,), NaN for all others."""
        return np.array([_number(self.fresh(value.address)) for value in self.values], np.float64)

    def ages(self) -> Floats:
        """The ages of the values, seconds, in the order of the addresses: shape (n,), NaN for a missing
        value."""
        ages = [float("nan") if value.age is None else value.age for value in self.values]
        return np.array(ages, np.float64)


@dataclass(frozen=True)
class Point:
    """A part that a camera found, for ``add_points``: mm and degrees.

    A field that is ``None`` is left out of the frame: the tool keeps its value. The manual always has all
    six fields. It is not known what a real controller does with a point without one, so give all of them
    if the wrist matters.
    """

    x: float
    y: float
    z: float | None = None
    angle: float | None = None
    """W; U on a four-axis robot, degrees."""
    u: float | None = None
    v: float | None = None
    model_id: int = 0
    """The template that recognised it."""
    similarity: float | None = None
    color: int | None = None
    relative: bool = False


Shot: TypeAlias = Union[Sequence[Point], Literal["failed", "not_mine"]]
"""What came of a request for a photo: the parts that are in the picture, perhaps none; ``"failed"`` if there is no picture,
which is answered with ``ret`` 0; ``"not_mine"`` if another program is this camera, and nothing is sent."""


@dataclass(frozen=True)
class Alarm:
    """The meaning of an alarm."""

    code: int
    text: str
    axis: int | None
    """The axis that it names, 0 for J1."""
    remedy: str
    """What to do about it."""
    seen_live: bool
    """Whether a real controller was seen to raise it."""
    known: bool
    """Whether it is in the table at all."""

    def __str__(self) -> str:
        return f"alarm {self.code}: {self.text}: {self.remedy}"


@dataclass(frozen=True)
class AddressInfo:
    """One row of the table of query addresses."""

    name: str
    """As the manual writes it; ``-n`` stands for the index."""
    indices: tuple[int, int] | None
    """The lowest and the highest index."""
    value: str
    """What the value is, in words."""
    unit: str
    meaning: str
    ports: Literal["both", "mainboard", "pendant"]
    since: str
    """The first manual or firmware that knows it."""
    source: str


@dataclass(frozen=True)
class LogLine:
    """An event of a virtual controller."""

    at: float | None
    """Seconds since it was switched on."""
    connection: int | None
    """On which connection; ``None`` for the machine itself."""
    warning: bool
    text: str
    """What, in English."""
    event: Mapping[str, Any]
    """What, as data: its word is ``event["event"]``, such as ``"alarm_raised"`` or ``"list_taken"``; its fields stand beside it."""


@dataclass(frozen=True, eq=False)
class MachineState:
    """The state of a virtual machine, as an operator sees it."""

    firmware: str
    machine_name: str
    profile: str
    model: str
    mode: int
    alarm: int
    emergency_stop: bool
    homed: bool
    moving: bool
    program: str
    programs: list[str]
    list_length: int
    axes: Floats
    """Shape (number of axes,), degrees, or mm where an axis slides."""
    pose: Floats
    """X, Y, Z, U, V, W: shape (6,), mm and degrees."""
    axis_limits: list[tuple[float, float]]
    """The lowest and the highest of each axis, in its unit."""
    global_speed: float
    """Percent."""
    connections: int
