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
"""The state of a step:

- ``queued``: not sent yet, or never sent if the motion has ended.
- ``sent``: in the controller's list.
- ``running``: the present step.
- ``done``: over.
- ``lost``: sent, and not seen to be over when the streaming ended.
"""

Quality: TypeAlias = Literal["fresh", "stale", "dead", "not_read", "unsupported", "unreadable"]
"""The quality of a value. Act only on ``fresh`` values."""

Wait: TypeAlias = Literal["on", "off", "rising", "falling"]
"""The condition that a step of a motion waits for."""


class OperationMode(IntEnum):
    """``curMode``. A controller may send another number, so modes are plain ``int`` everywhere."""

    NONE = 0
    MANUAL = 1
    """The pendant controls the arm."""
    AUTO = 2
    """Automatic, not running."""
    STOP = 3
    RUNNING = 7
    """The program runs. It takes instructions while it is in its wait step."""
    SINGLE_STEP = 8
    SINGLE_CYCLE = 9


@dataclass(frozen=True)
class Counter:
    """A counter of the controller."""

    id: int
    target: int
    """The target count."""
    current: int
    """The present count."""
    name: str | None
    """Only older firmware reports it."""


Reading: TypeAlias = Union[str, int, float, bool, "list[str]", Counter]
"""The value of an address: text, whole number, decimal number in the unit of its address, 32 points as an
``int`` (bit 0 is the first), flag, list of texts, or counter."""


class QueryResult(Mapping[str, Reading]):
    """The values of some addresses, under the names of the query. It has only addresses with a value.

    Values that took several frames to read are not from the same instant.
    """

    __slots__ = ("_values", "missing", "took")

    missing: dict[str, str]
    """The addresses without a value, and the reason."""
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

    kind: Literal["mode", "alarm", "not_homed", "moving", "leftover_list", "other_program", "unknown"]
    value: int | None
    """The mode, the alarm, or the number of instructions left."""
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
    """Only the pendant's port reports it."""
    mode: int | None
    """See ``OperationMode``."""
    alarm: int | None
    """0 for no alarm; ``r6.alarm`` gives the meaning."""
    homed: bool | None
    moving: bool | None
    axis_count: int | None
    axes: Floats
    """J1 to J6: shape (6,); J1 is ``axes[0]``. Degrees, or mm for a linear axis (no address says which); NaN if
    not known."""
    pose: Floats
    """X, Y, Z, U, V, W: shape (6,), mm and degrees, NaN if not known."""
    list_length: int | None
    """Instructions left in the instruction list. Older firmware does not report it."""
    list_is_unreadable: bool
    """A length of the list came that cannot be read: the list may have instructions. The robot is not ready then."""
    cycle: float | None
    """Time of the present cycle, seconds."""
    last_cycle: float | None
    """Time of the last cycle, seconds."""
    unmet: tuple[Unmet, ...]
    """The conditions that keep the machine from taking instructions, in the order in which to resolve
    them."""
    unproved: tuple[Literal["remote_step", "list_length"], ...]
    """Conditions that no value proves:

    - ``remote_step``: whether the program is in its step that waits for remote commands. No firmware
      reports it.
    - ``list_length``: how many instructions are left in the list. Older firmware does not report it.
    """
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
    """J1 to J6: shape (6,); J1 is ``axes[0]``. Degrees, or mm for a linear axis (no address says which); NaN if
    not known."""
    pose: Floats
    """X, Y, Z, U, V, W: shape (6,), mm and degrees, NaN if not known."""
    mode: int | None
    moved: bool
    """Whether a read showed that the arm moved, or a list that was not empty."""
    motion: int | None
    """The number of the motion (``MotionHandle.number``); ``None`` if it was none of this robot's motions."""
    proof: Literal["reached", "consumed", "cut_short", "at_rest"]
    """The proof of the end:

    - ``reached``: the arm stands where the last move ends.
    - ``consumed``: the controller was seen to work through its list.
    - ``cut_short``: an input cut the last move short.
    - ``at_rest``: the arm stands with an empty list, and it is not known where it should stand.
    """
    cut_short: str | None
    """Where the arm should have been, if an input cut its last move short."""
    took: float
    """Seconds since the first read."""


@dataclass(frozen=True, eq=False)
class Followed:
    """A target was followed to the end, and the arm stands."""

    steps: int
    """The number of steps made."""
    axes: Floats
    """J1 to J6: shape (6,); J1 is ``axes[0]``. Degrees, or mm for a linear axis (no address says which); NaN if
    not known."""
    behind: float | None
    """The distance of the farthest axis from the last target, degrees; mm for a linear axis. ``None`` if
    there was no target, or the position of an axis is not known."""


@dataclass(frozen=True)
class Accepted:
    """The controller accepted the request. This does not mean that the arm moves."""

    after: float
    """How long the reply took, seconds."""
    points: int | None
    """The number of accepted points; only for ``add_points``."""


@dataclass(frozen=True)
class StopReport:
    """The result of a stop. As text it says the result.

    Look at ``confirmed`` first: only if it is true, the arm is proved to stand. If not, use the emergency stop.
    ``mode``, ``alarm``, ``moving`` and ``list_length`` are what was read last, and ``None`` if it could not be
    read; ``took`` is in seconds.
    """

    confirmed: bool
    """Whether it is proved that the arm stands. If not, use the emergency stop."""
    proof: Literal["not_running", "empty_list"] | None
    """The proof: a mode in which no program runs. If ``RobotSettings.stays_in_mode_7`` is set, also a long
    rest with an empty list (a taught program may still run)."""
    means: str | None
    """The last request sent before that: ``actionStop``, ``stopButton``, ``actionPause``, or ``AddRCC`` (an
    empty list)."""
    second_connection: Literal["used", "answered", "silent", "opening", "not_made", "unidentified"] | None
    """The state of a second connection; ``None`` if the first answer was in time."""
    in_doubt: bool | None
    """Whether a frame that can move the arm is still unanswered; ``None`` if there was no such frame when the
    stop began."""
    attempts: int
    """How many stops were sent."""
    took: float
    """Seconds until the standstill was proved, or the stop was given up."""
    robot: Identity | None
    """The robot that was stopped; ``None`` if it did not report its identity."""
    connection: int
    """The number of the connection over which the standstill was read. A second connection has its own
    numbers."""
    moving: bool | None
    mode: int | None
    alarm: int | None
    """42 after a stop is usual on some firmware."""
    list_length: int | None
    list: Literal["was_empty", "cleared", "refused", "unknown", "not_tried"]
    """What became of the instructions that were left. An instruction that is not cleared may run at the next
    start."""
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
    """The state of the link. Only a reply proves that a controller is alive; an open socket proves
    nothing."""
    latency: Latency | None
    """``None`` if there was no reply in the last minute."""
    requests: int
    replies: int
    timeouts: int
    lost: int
    """Requests whose connection ended before their reply."""
    strays: int
    """Frames that answered no request."""
    garbled: int
    """Bytes that were no frame, and frames that were no JSON."""
    reconnects: int
    last_reply: float | None
    """Seconds since the last reply."""
    silent_for: float | None
    """Seconds during which requests got no reply, or the connection was gone."""


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
    """Counted from 1; ``None`` for the whole file."""
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
    """As the caller gave it."""
    who: Identity | RequestError
    """The controller that answered, or why there was no answer."""


@dataclass(frozen=True)
class Photo:
    """The controller asks for a photo: answer it with ``answer_photo``."""

    cam_id: int


@dataclass(frozen=True)
class PhotosEnded:
    """Why photos are no longer served. As text it says what to do."""

    reason: Literal["connection_lost", "stopped", "closed", "served_already", "request", "fell_behind"]
    """The reason:

    - ``connection_lost``: requests no longer arrive. Check the machine (``Robot.status`` reconnects), then
      serve again.
    - ``stopped``: a handle of this connection sent a stop or a pause while a picture was under way, and
      its points were not sent. Check the machine, then serve again.
    - ``closed``: the robot was closed.
    - ``served_already``: another call serves the photos of this connection, and nothing was sent.
    - ``request``: an answer did not leave, the points were not accepted, or they cannot be sent. In the
      last case the request got no answer.
    - ``fell_behind``: events were missed, and requests may be among them. Serve again.
    """
    cam_id: int | None
    """The camera whose request failed."""
    error: RequestError | None
    """The error of that request."""
    missed: int | None
    """The number of missed events."""
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Stray:
    """A frame that does not answer any waiting request."""

    text: str
    frame: bytes
    """Cut at 4096 bytes."""


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
    """Whether this is another robot than before. If so, no command is sent until ``accept_identity``."""
    mode: int | None
    alarm: int | None
    list_length: int | None


@dataclass(frozen=True)
class Missed:
    """Events that were dropped because they were not read in time."""

    count: int


Event: TypeAlias = Union[Photo, Stray, Garbled, ConnectionLost, Reconnected, Missed]
"""An event on a connection, which comes without a request."""


@dataclass(frozen=True)
class Value:
    """The last value of an address, and its quality."""

    address: str
    reading: Reading | None
    age: float | None
    """Seconds since it was asked for: it is no older. ``None`` if no answer ever came."""
    quality: Quality
    problem: str | None
    """What is wrong with an ``unreadable`` value."""


@dataclass(frozen=True)
class Snapshot:
    """The values of a subscription at one moment, in the order of its addresses. Each value has its own
    age."""

    values: tuple[Value, ...]
    failure: RequestError | None
    """Why the last poll failed; ``None`` if it succeeded."""

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
    """W in degrees, absolute, not an offset; U on a four-axis robot. With the tool straight down W is near
    180, so 0 turns the wrist half round."""
    u: float | None = None
    v: float | None = None
    model_id: int = 0
    """The template that recognised it."""
    similarity: float | None = None
    color: int | None = None
    relative: bool = False


Shot: TypeAlias = Union[Sequence[Point], Literal["failed", "not_mine"]]
"""The result of a photo request: the parts in the picture, perhaps an empty list. ``"failed"``: there is no
picture, and the answer is ``ret`` 0. ``"not_mine"``: another program is this camera, and nothing is sent."""


@dataclass(frozen=True)
class Alarm:
    """The meaning of an alarm."""

    code: int
    text: str
    axis: int | None
    """The axis of the alarm, 0 for J1."""
    remedy: str
    """What to do about it."""
    seen_live: bool
    """Whether a real controller was seen to raise it."""
    known: bool
    """Whether the table has it."""

    def __str__(self) -> str:
        return f"alarm {self.code}: {self.text}: {self.remedy}"


@dataclass(frozen=True)
class AddressInfo:
    """One row of the table of query addresses."""

    name: str
    """As in the manual; ``-n`` stands for the index."""
    indices: tuple[int, int] | None
    """The lowest and the highest index."""
    value: str
    """A description of the value."""
    unit: str
    meaning: str
    ports: Literal["both", "mainboard", "pendant"]
    since: str
    """The first manual or firmware that has it."""
    source: str


@dataclass(frozen=True)
class LogLine:
    """An event of a virtual controller."""

    at: float | None
    """Seconds since it was switched on."""
    connection: int | None
    """The number of the connection; ``None`` for the machine itself."""
    warning: bool
    text: str
    """The event in English."""
    event: Mapping[str, Any]
    """The event as data: ``event["event"]`` is its name, such as ``"alarm_raised"`` or ``"list_taken"``,
    beside its fields."""


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
    """Shape (number of axes,); J1 is ``axes[0]``. Degrees, or mm for a linear axis."""
    pose: Floats
    """X, Y, Z, U, V, W: shape (6,), mm and degrees."""
    axis_limits: list[tuple[float, float]]
    """The lowest and the highest position of each axis, in its unit."""
    global_speed: float
    """In percent."""
    connections: int
