"""The native half of ``r6``. Import ``r6`` instead."""

import asyncio
from collections.abc import Callable, Sequence
from os import PathLike
from types import GenericAlias, TracebackType
from typing import Any, Generic, Literal, TypeVar, final

import numpy.typing as npt
from typing_extensions import Self, disjoint_base

from ._types import (
    Accepted,
    AddressInfo,
    Alarm,
    Discovered,
    Done,
    Event,
    Followed,
    Identity,
    Integers,
    LinkQuality,
    LogLine,
    MachineState,
    PhotosEnded,
    Point,
    QueryResult,
    Shot,
    Snapshot,
    Status,
    StepState,
    StopReport,
    Wait,
)
__all__ = [
    "AxisMask",
    "AxisPosition",
    "Block",
    "Command",
    "Degrees",
    "Envelope",
    "FollowCore",
    "FollowOptions",
    "Listen",
    "Millimetres",
    "MillimetresPerSecond",
    "Motion",
    "MotionCore",
    "Operation",
    "Percent",
    "Plot",
    "PhotosCore",
    "Pose",
    "Program",
    "Progress",
    "PushedCore",
    "RobotCore",
    "RobotSettings",
    "RunOptions",
    "Simulator",
    "Started",
    "Starting",
    "SubscriptionCore",
    "addresses",
    "alarm",
    "discovering",
    "ended_as_asked",
    "from_thousandths",
    "models",
    "profiles",
    "remade",
    "to_thousandths",
    "tasks",
    "told",
    "word_of",
]

_T = TypeVar("_T")
_T_co = TypeVar("_T_co", covariant=True)

@final
class Operation(Generic[_T_co]):
    """An operation that takes time and has not begun: ``wait`` or ``start`` it, once."""

    def wait(self) -> _T_co:
        """Waits with the interpreter released. A signal handler that raises, as Ctrl-C does, ends the wait
        within 50 ms."""
    def start(
        self,
        tell: Callable[[BaseException | None, Any], object],
        event_loop: asyncio.AbstractEventLoop | None = None,
        future: asyncio.Future[Any] | None = None,
    ) -> Started:
        """Begins the operation, and sets the result of ``future``, which belongs to ``event_loop``. Call it
        in the thread of the event loop. Work that the event loop does not do itself runs in the
        background, and another thread calls ``tell(error, value)`` at its end."""

@final
class Started:
    """A started operation."""

    def cancel(self) -> None:
        """Drops the rest of the operation. Does nothing if it has ended or cannot be cancelled, as a stop."""
    @property
    def goes_on(self) -> str | None:
        """The note for a caller that gives up waiting, if the operation continues then."""

@final
class Starting:
    """A motion on its way to its handle. From its first byte on it has an owner: the handle or a stop. If
    this is dropped before ``take``, the arm is stopped."""

    UNOWNED: str
    """A note above the result of the stop: the call ended before it returned the handle of a motion that had
    begun."""
    @property
    def operation(self) -> Operation[None]:
        """The operation that makes the motion. Nothing begins before it does."""
    def take(self) -> MotionCore:
        """Takes the motion, once it is made."""
    def hand_over(self, handle: type[_T]) -> _T:
        """Waits until the motion is made, and returns its handle, an object of this class."""
    def give_up(self) -> Operation[StopReport | None] | None:
        """Stops the arm if there is a motion, taken or not. The call itself begins the stop. ``None`` if
        there is certainly no motion."""
    def given_up(self, error: BaseException) -> None:
        """Gives up and waits for the stop through all signals, and adds the result to the exception that kept
        the caller from the handle."""

@disjoint_base
class Block(Generic[_T_co]):
    """The end of a running motion and of a followed target, as a ``with`` block. It is native code, so that
    no signal handler runs between its lines."""

    def __new__(cls, core: _T_co) -> Self:
        """Use ``Robot.run`` or ``Robot.follow``."""
    def __class_getitem__(cls, key: Any) -> GenericAlias: ...
    @property
    def _core(self) -> _T_co: ...
    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        _kind: type[BaseException] | None,
        error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        """Stops the arm after an exception. Otherwise waits for the end, and stops the arm if a signal
        interrupts the wait."""

@final
class RobotCore:
    """The common part of ``Robot`` and ``AsyncRobot``."""

    @staticmethod
    def connect(address: str | Listen, settings: RobotSettings | None = None) -> Operation[RobotCore]: ...
    @staticmethod
    def connect_async(address: str | Listen, settings: RobotSettings | None = None) -> Operation[RobotCore]: ...
    @property
    def address(self) -> str: ...
    def close(self) -> Operation[str | None]: ...
    def query(self, *addresses: str) -> Operation[QueryResult]: ...
    def status(self) -> Operation[Status]: ...
    def firmware(self) -> Operation[str | None]: ...
    def command(self, command: Command) -> Operation[Accepted]: ...
    def clear_list(self) -> Operation[Accepted]: ...
    def add_rcc(self, motion: Motion, replace: bool) -> Operation[Accepted]: ...
    def wait_until_done(
        self, timeout: float, interval: float, settle: float, start_within: float, idle_mode: int
    ) -> Operation[Done]: ...
    def stop(self) -> Operation[StopReport]: ...
    def run(self, motion: Motion, options: RunOptions | None = None) -> Starting: ...
    def follow(self, options: FollowOptions | None = None) -> FollowCore: ...
    def dry_run(self, motion: Motion, options: RunOptions | None = None) -> list[bytes]: ...
    def read_registers(self, first: int, count: int) -> Operation[Integers]: ...
    def write_registers(
        self, first: int, values: Sequence[int], *, savable: bool, verify: bool
    ) -> Operation[None]: ...
    def subscribe(self, addresses: Sequence[str], every: float) -> SubscriptionCore: ...
    def pushed(self) -> PushedCore: ...
    def answer_photo(self, cam_id: int, taken: bool) -> Operation[None]: ...
    def add_points(self, cam_id: int, points: Sequence[Point]) -> Operation[Accepted]: ...
    def serve_photos(self) -> PhotosCore: ...
    def link_quality(self) -> LinkQuality: ...
    def identity(self) -> Identity | None: ...
    def accept_identity(self, found: Identity) -> None: ...
    def guard(self) -> Envelope | None: ...
    def with_guard(self, envelope: Envelope) -> RobotCore: ...

@final
class MotionCore:
    """The common part of ``MotionHandle`` and ``AsyncMotionHandle``."""

    @property
    def number(self) -> int: ...
    def progress(self) -> Progress: ...
    def next_progress(self) -> Operation[Progress | None]: ...
    def step_state(self, step: int) -> StepState: ...
    def step_started(self, step: int) -> Operation[bool]: ...
    def step_done(self, step: int) -> Operation[bool]: ...
    def ended_within(self, time: float) -> Operation[bool]: ...
    def finished(self) -> Operation[Done]: ...
    @property
    def stop_asked(self) -> bool: ...
    def stop(self) -> Operation[StopReport]: ...
    def release(self) -> None: ...

@final
class FollowCore:
    """The common part of ``Following`` and ``AsyncFollowing``."""

    def target(self, to: AxisPosition) -> None: ...
    def finished(self) -> Operation[Followed]: ...
    @property
    def stop_asked(self) -> bool: ...
    def stop(self) -> Operation[StopReport]: ...
    def release(self) -> None: ...

@final
class SubscriptionCore:
    """The common part of ``Subscription`` and ``AsyncSubscription``."""

    def latest(self) -> Operation[Snapshot | None]: ...
    def next(self, timeout: float | None) -> Operation[Snapshot | None]: ...
    def close(self) -> None: ...

@final
class PushedCore:
    """The common part of ``PushedEvents`` and ``AsyncPushedEvents``."""

    def next(self, timeout: float | None) -> Operation[Event | None]: ...

@final
class PhotosCore:
    """The common part of ``serve_photos`` in ``Robot`` and ``AsyncRobot``."""

    def next(self) -> Operation[int | PhotosEnded]: ...
    def answer(self, shot: Shot) -> None: ...
    def close(self) -> Operation[None]: ...

@final
class Listen:
    """Waits for a controller that connects to this program: for ``Robot.connect``.

    The pendant sets each port of a controller to server mode or client mode. In client mode the controller
    connects to the address that is set there. It tries again until a program listens there.

    - ``address``: where to listen, such as ``"0.0.0.0:9760"``. Port 0 takes a free port.
    - ``only_from``: the IP address of the controller. Connections from other machines are closed at once.
      Set it, because there is no login: any machine that reaches the port is taken for the controller.

    It serves one ``connect``, which waits for ``RobotSettings.connect_timeout`` seconds, as the robot does
    after a lost connection. Set a longer time than the controller takes to connect again. If several
    connections wait, the newest is used. The port is closed with the robot, or when connecting fails.

    Errors: ``OSError`` if the port is in use or this machine does not have the address; ``ValueError``.
    """

    def __new__(cls, address: str, *, only_from: str | None = None) -> Listen: ...
    @property
    def address(self) -> str:
        """Where it listens, ``host:port``, with the port that port 0 took."""

@final
class Progress:
    """The progress of a motion, from the controller's state. Its steps are done in order."""

    @property
    def total(self) -> int:
        """Steps of the motion."""
    @property
    def left(self) -> int:
        """Steps that were sent: the accepted ones, and those of a frame whose answer has not come."""
    @property
    def accepted(self) -> int:
        """Steps that were accepted."""
    @property
    def done(self) -> int:
        """Steps that are over."""
    @property
    def ended(self) -> bool:
        """Whether nothing more is sent and the state is no longer read."""
    @property
    def current(self) -> int:
        """The present step, counted from 1; the last step if all are over."""
    @property
    def under_way(self) -> int:
        """Steps that were sent and not seen to be over."""
    def step(self, step: int) -> StepState:
        """The state of a step, counted from 1; ``IndexError`` if there is no such step."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Degrees:
    """An angle, degrees."""

    def __new__(cls, value: float) -> Degrees: ...
    @property
    def value(self) -> float:
        """The number alone."""
    def nearest_to(self, present: Degrees) -> Degrees:
        """The same angle, with full turns added or subtracted, that is nearest to another: at most half a
        turn from it. For U, V and W, and for an axis that may turn further. It is not for an axis whose
        limits leave no choice."""
    def __add__(self, other: Degrees, /) -> Degrees: ...
    def __radd__(self, other: Degrees, /) -> Degrees: ...
    def __sub__(self, other: Degrees, /) -> Degrees: ...
    def __rsub__(self, other: Degrees, /) -> Degrees: ...
    def __mul__(self, times: float, /) -> Degrees: ...
    def __rmul__(self, times: float, /) -> Degrees: ...
    def __neg__(self) -> Degrees: ...
    def __abs__(self) -> Degrees: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __lt__(self, other: Degrees, /) -> bool: ...
    def __le__(self, other: Degrees, /) -> bool: ...
    def __gt__(self, other: Degrees, /) -> bool: ...
    def __ge__(self, other: Degrees, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class Millimetres:
    """A length, millimetres."""

    def __new__(cls, value: float) -> Millimetres: ...
    @property
    def value(self) -> float:
        """The number alone."""
    def __add__(self, other: Millimetres, /) -> Millimetres: ...
    def __radd__(self, other: Millimetres, /) -> Millimetres: ...
    def __sub__(self, other: Millimetres, /) -> Millimetres: ...
    def __rsub__(self, other: Millimetres, /) -> Millimetres: ...
    def __mul__(self, times: float, /) -> Millimetres: ...
    def __rmul__(self, times: float, /) -> Millimetres: ...
    def __neg__(self) -> Millimetres: ...
    def __abs__(self) -> Millimetres: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __lt__(self, other: Millimetres, /) -> bool: ...
    def __le__(self, other: Millimetres, /) -> bool: ...
    def __gt__(self, other: Millimetres, /) -> bool: ...
    def __ge__(self, other: Millimetres, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class Percent:
    """A percentage of the maximum: the speed of a move, 0.1 to 100 in steps of 0.1; else ``OutOfRange``.

    In an axis move at 100 % the axis that needs most time goes at its full speed. A linear move at 100 % goes
    2000 mm/s (reported). The global speed multiplies both.
    """

    def __new__(cls, value: float) -> Percent: ...
    @property
    def value(self) -> float:
        """The number alone."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __lt__(self, other: Percent, /) -> bool: ...
    def __le__(self, other: Percent, /) -> bool: ...
    def __gt__(self, other: Percent, /) -> bool: ...
    def __ge__(self, other: Percent, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class MillimetresPerSecond:
    """The speed of the tool along its path, before the global speed: a whole number of mm/s, 1 to 10 000. A
    ``float`` is a ``TypeError``, any other number ``OutOfRange``. A fraction raised alarm 219 (reported)."""

    def __new__(cls, value: int) -> MillimetresPerSecond: ...
    @property
    def value(self) -> float:
        """The number alone."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __lt__(self, other: MillimetresPerSecond, /) -> bool: ...
    def __le__(self, other: MillimetresPerSecond, /) -> bool: ...
    def __gt__(self, other: MillimetresPerSecond, /) -> bool: ...
    def __ge__(self, other: MillimetresPerSecond, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class AxisMask:
    """A set of axes, by their numbers: 0 (J1) to 7 (J8)."""

    def __new__(cls, *axes: int) -> AxisMask: ...
    @property
    def bits(self) -> int:
        """Bit n is axis n, as in ``ckStatus``."""
    @property
    def axes(self) -> list[int]:
        """The numbers of its axes."""
    def __contains__(self, number: int, /) -> bool: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class AxisPosition:
    """Positions of one to eight axes. An axis that is not named does not move."""

    def __new__(cls) -> AxisPosition:
        """No axis: for ``with_axis``."""
    @staticmethod
    def degrees(angles: npt.ArrayLike) -> AxisPosition:
        """Positions of J1 and the next axes: 1 to 8 bare numbers, shape (n,), degrees."""
    def with_axis(self, axis: int, to: Degrees | Millimetres) -> AxisPosition:
        """A copy with another position of one axis, 0 for J1; ``Millimetres`` for a linear axis."""
    def at(self, axis: int) -> Degrees | Millimetres | None:
        """The position of this axis, 0 for J1; ``None`` if it is not named."""
    @property
    def mask(self) -> AxisMask:
        """The named axes."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Pose:
    """Position and orientation of the tool, in the work frame; or only its position.

    +180° and −180° are the same orientation and a full turn of the wrist apart. Give the value nearer to
    the present one (``nearest_to``), or use ``position``.
    """

    def __new__(
        cls, x: Millimetres, y: Millimetres, z: Millimetres, u: Degrees, v: Degrees, w: Degrees
    ) -> Pose: ...
    @staticmethod
    def position(x: Millimetres, y: Millimetres, z: Millimetres) -> Pose:
        """X, Y, Z, each a ``Millimetres``; the tool keeps its orientation. ``mm_deg`` takes bare numbers."""
    @staticmethod
    def mm_deg(values: npt.ArrayLike) -> Pose:
        """X, Y, Z in mm, shape (3,), or X, Y, Z, U, V, W in mm and degrees, shape (6,): bare numbers."""
    def nearest_to(self, present: tuple[Degrees, Degrees, Degrees]) -> Pose:
        """The same pose with each of U, V and W as near as possible to the present values (``world-3`` to
        ``world-5``). A real arm that read U −180 and was sent to +180 turned its wrist the long way round
        (reported). A pose without an orientation does not change."""
    @property
    def place(self) -> tuple[Millimetres, Millimetres, Millimetres]:
        """X, Y, Z."""
    @property
    def turn(self) -> tuple[Degrees, Degrees, Degrees] | None:
        """U, V, W, if they are given."""
    @property
    def mask(self) -> AxisMask:
        """The components that are given."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Motion:
    """Moves, outputs and waits in order. Every step runs once, unless the motion repeats.

    Each method adds a step, or changes the last one, and returns the motion itself, so that a motion can
    be written as one chain. A wrong step raises ``StepError`` at once and makes the motion unusable: no
    part of it is ever sent. At most 100 000 steps.
    """

    def __new__(cls) -> Motion: ...
    def axis_move(self, to: AxisPosition, speed: Percent) -> Motion:
        """Moves the axes to an ``AxisPosition``, all arriving together (action 4); ``speed`` is a ``Percent``."""
    def linear_move(self, to: Pose, speed: Percent) -> Motion:
        """Moves the tool straight to a ``Pose`` (action 10); ``speed`` is a ``Percent``, 100 % is 2000 mm/s
        (reported)."""
    def linear_move_at_path_speed(self, to: Pose) -> Motion:
        """The same at the speed that ``path_speed`` set."""
    def curve_move(self, through: Pose, to: Pose, speed: Percent) -> Motion:
        """Moves the tool through a middle pose to an end pose (action 17). Begin with a linear move: a
        controller accepted a curve without one and did not make it (reported)."""
    def axis_path(self, positions: npt.ArrayLike, speed: Percent, blend: int | None = None) -> Motion:
        """Adds an axis move for each row: shape (n, k), k from 1 to 8 axes, degrees. ``blend``: as in
        ``blend``, for each move."""
    def linear_path(self, poses: npt.ArrayLike, speed: Percent, blend: int | None = None) -> Motion:
        """Adds a linear move for each row: shape (n, 3), mm, or (n, 6), mm and degrees. ``blend``: as in
        ``blend``."""
    def blend(self, level: int) -> Motion:
        """Rounds the corner after the last step, a move: 0 stops there, 9 rounds most."""
    def delay(self, time: float) -> Motion:
        """Waits before the last step, a move: seconds, at most a day, in steps of 0.1 s."""
    def tool(self, number: int) -> Motion:
        """Makes the last step, a move, with this tool frame."""
    def work_frame(self, number: int) -> Motion:
        """Makes the last step, a move, in this work frame."""
    def path_speed(self, speed: MillimetresPerSecond) -> Motion:
        """Sets the speed of later linear moves without their own speed (action 51)."""
    def set_output(self, point: str, on: bool) -> Motion:
        """Sets an output of the first board, by its name on the pendant: ``"Y010"`` to ``"Y047"``, M, EUY
        (action 200)."""
    def pulse_output(self, point: str, on: bool, time: float) -> Motion:
        """Sets an output Y for a time, seconds, then sets it back (action 200, timed)."""
    def set_board(self, points: dict[str, bool]) -> Motion:
        """Sets several outputs of one board at once, by their names on the pendant: ``{"Y010": True, "Y017":
        False}``. The board is one of the first two of Y or M: ``"Y1.010"``, ``"M010"`` (action 204). Other
        points do not change."""
    def wait(self, time: float) -> Motion:
        """Waits for a time, seconds, while the arm stands (action 100)."""
    def wait_for(self, point: str, condition: Wait = "on", *, limit: float | None = None) -> Motion:
        """Waits for ``"X010"``, M or EUX, while the arm stands: at most ``limit`` seconds, without it for
        ever (action 100)."""
    def stop_on_input(self, point: str, on: bool) -> Motion:
        """Lets an input of the first board, ``"X010"`` to ``"X047"``, stop the motion from here on when it
        changes to this state (action 52)."""
    def workbench(self, number: int) -> Motion:
        """Changes the workbench (action 800)."""
    def extend(self, other: Motion) -> Motion:
        """Adds the steps of another motion."""
    def repeat(self) -> Motion:
        """Keeps every step so far in the controller's list, so that the list starts over after its end until
        the arm is stopped. Such a motion has to fit into the list as a whole (``RunOptions.room``).
        ``MotionHandle.finished`` then ends only with an error: call ``MotionHandle.stop`` before the end
        of a ``with`` block. The motion also continues if this program dies."""
    @property
    def repeats(self) -> bool:
        """Whether a step stays in the controller's list, so that the motion has no end of its own."""
    def plot(
        self,
        *,
        model: str | PathLike[str] | None = None,
        profile: str | PathLike[str] | None = None,
        global_speed: Percent | None = None,
        start: AxisPosition | None = None,
    ) -> Plot:
        """Plays the motion on a virtual controller and draws it. No robot is asked, and no time passes. A
        motion that repeats is played once. Inputs are off.

        - ``model`` (``"BRTIRUS0707A"``), ``profile`` (``"hc1"``): a name or a path, as for ``Simulator``.
        - ``global_speed`` (100 %): at least 0.1 %.
        - ``start``: where the axes stand before it; 0 for those that are not named.

        An alarm, or a wait for a signal that never comes, ends the picture: ``Plot.trouble`` says which.

        Errors: ``SimulatorError`` if the model or the profile is wrong; ``ValueError`` if the motion cannot
        be played: more than 10 000 steps, a start out of reach, a step that this firmware does not know.
        """
    def __getitem__(self, key: int | slice, /) -> Motion:
        """A step, or steps that follow one another, as a motion of its own: ``motion[2]``, ``motion[2:5]``. A
        path speed that was set before them is not in it; a move that needs one is a ``StepError`` then."""
    def __len__(self) -> int:
        """The number of steps."""
    def __copy__(self) -> Motion: ...
    def __deepcopy__(self, _memo: Any) -> Motion: ...

@final
class RobotSettings:
    """Settings of a connection to a robot. The defaults suit every known firmware. Times are seconds.

    - ``reply_timeout`` (2): how long a reply may take.
    - ``connect_timeout`` (3): how long an attempt to connect may take.
    - ``max_frame_bytes`` (2048): controllers neither answer nor execute longer lists.
    - ``heartbeat`` (None: off): the time from one heartbeat to the next, 0.1 to 5. Other values are refused.
      The first heartbeat arms a watchdog, which raises an alarm if no heartbeat comes for 10 s, also after
      this program has died.
    - ``suspect_after`` (1), ``dead_after`` (5): after how much silence values and connection are no longer
      trusted.
    - ``reconnect_first_wait`` (0.1), ``reconnect_cap`` (5), ``reconnect_seed``: the waits between attempts to
      reconnect.
    - ``type_key`` ("reqType"): the key of a request's type, ``"cmdType"`` for the oldest firmware.
    - ``ds_id`` ("long"): the form of ``dsID``, ``"short"`` for older firmware (``HCRemoteMonitor``).
    - ``stays_in_mode_7`` (False): whether this controller stays in mode 7 after a stop that it carried out.
      No known controller does. If it is true, a rest of 2 s with an empty list also proves the standstill. A
      taught program that waits longer may then still move the arm.
    """

    def __new__(
        cls,
        *,
        reply_timeout: float | None = None,
        connect_timeout: float | None = None,
        max_frame_bytes: int | None = None,
        heartbeat: float | None = None,
        suspect_after: float | None = None,
        dead_after: float | None = None,
        reconnect_first_wait: float | None = None,
        reconnect_cap: float | None = None,
        reconnect_seed: int | None = None,
        type_key: Literal["reqType", "cmdType"] | None = None,
        ds_id: Literal["long", "short"] | None = None,
        stays_in_mode_7: bool = False,
    ) -> RobotSettings: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Program:
    """A motion from a file of ``r6 run``: TOML (``[[instruction]]`` tables), or AddRCC frames in JSON.

    ::

        program = r6.Program.load("square.toml")
        robot.run(program.motion, r6.RunOptions(append=program.append)).finished()
    """

    @staticmethod
    def load(path: str | PathLike[str]) -> Program:
        """Reads a file of at most 16 MiB.

        Errors: ``FileError`` with every mistake, its line and its column; ``OSError`` and ``ValueError``
        if it cannot be read.
        """
    @staticmethod
    def read(text: str) -> Program:
        """Reads a text. Errors: ``FileError``."""
    @property
    def motion(self) -> Motion:
        """Its steps, as a copy: changing it does not change the program. It repeats if the file says so."""
    @property
    def append(self) -> bool:
        """Whether the file says to append to the list: for ``RunOptions.append``."""
    @property
    def remarks(self) -> list[str]:
        """Remarks for the author of the file: older spellings, keys without a meaning."""
    def plot(
        self,
        *,
        model: str | PathLike[str] | None = None,
        profile: str | PathLike[str] | None = None,
        global_speed: Percent | None = None,
        start: AxisPosition | None = None,
    ) -> Plot:
        """Plays it on a virtual controller and draws it, as ``Motion.plot`` does."""
    def __len__(self) -> int: ...

@final
class Plot:
    """What a motion does: axis positions, axis speeds and outputs over time, and the path of the tool. A
    notebook shows it as a picture.

    ::

        plot = r6.Program.load("square.toml").plot()
        plot.save("square.svg")
        assert plot.trouble is None
    """

    @property
    def svg(self) -> str:
        """The picture as SVG. The same motion gives the same text."""
    @property
    def duration(self) -> float:
        """How long the motion takes, seconds."""
    @property
    def trouble(self) -> str | None:
        """Why the motion does not get to its end: an alarm, or a wait that never ends; ``None`` if it does."""
    def save(self, path: str | PathLike[str]) -> None:
        """Writes the picture to a file. It replaces an existing file. Errors: ``OSError``."""
    def _repr_svg_(self) -> str: ...

@final
class RunOptions:
    """Options of a motion. Times are seconds.

    - ``interval`` (0.05): the pause between two reads of the state; 0 reads as fast as answers come.
    - ``frame_instructions`` (8): how many instructions one frame has at most.
    - ``room`` (24): how many instructions the controller's list has at most. They still run if the connection
      breaks.
    - ``settle`` (0.5): how long the arm has to stand if the controller cannot report the length of its list.
    - ``start_within`` (1): how long the arm may stand away from the end of an accepted list while its list is
      empty.
    - ``stall_within`` (5): how long the arm may stand without progress.
    - ``idle_mode`` (7): the mode in which this controller waits for instructions.
    - ``clear_leftover`` (False): clear a list that is left from before.
    - ``append`` (False): append to the list, which may be running. The motion is sent at once and as a whole,
      and its steps are not counted.
    - ``stop_on_failure`` (True): stop the arm if the motion fails after something was sent.
    - ``stop_on_drop`` (False): stop the arm when the handle is dropped or released, or the robot is closed.
      Without it, a motion whose handle is dropped goes on to its end. A motion whose robot is closed ends
      with the instructions in the controller's list.
    """

    def __new__(
        cls,
        *,
        interval: float | None = None,
        frame_instructions: int | None = None,
        room: int | None = None,
        settle: float | None = None,
        start_within: float | None = None,
        stall_within: float | None = None,
        idle_mode: int | None = None,
        clear_leftover: bool | None = None,
        append: bool | None = None,
        stop_on_failure: bool | None = None,
        stop_on_drop: bool | None = None,
    ) -> RunOptions: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class FollowOptions:
    """Options for following a moving target. Times are seconds.

    The protocol has no command for it: each step is its own instruction. Small steps without a pause have
    overloaded the servos of a real arm (reported). Its operator cut the speed to 20 %, made the steps larger,
    and sent each step only while the arm stood. The defaults do the same.

    - ``interval`` (0.05): the time between two checks of target and arm, 0.02 at least.
    - ``speed`` (20 %): the speed of each step.
    - ``smallest_step`` (1°): if the target is nearer than this, the arm does not move.
    - ``largest_step`` (10°): the most that a step moves an axis. It also bounds how far the arm still goes
      after targets, program or link are gone: two such steps. Both are mm for a linear axis.
    - ``while_moving`` (False): append a step while the arm makes the step before. On a real arm try it at low
      speed, and watch the load of the servos (``curTorque-n``).
    - ``fresh_within`` (0.5): how long a target counts if no other target comes, not even the same again.
    - ``start_within`` (1): how long the arm may stand away from the end of a step after the controller
      accepted it.
    - ``stall_within`` (5): how long a step may go on without progress.
    - ``idle_mode`` (7): as in ``RunOptions``.
    - ``stop_on_failure`` (True): stop the arm if following fails after a step was sent.
    """

    def __new__(
        cls,
        *,
        interval: float | None = None,
        speed: Percent | None = None,
        smallest_step: Degrees | None = None,
        largest_step: Degrees | None = None,
        while_moving: bool | None = None,
        fresh_within: float | None = None,
        start_within: float | None = None,
        stall_within: float | None = None,
        idle_mode: int | None = None,
        stop_on_failure: bool | None = None,
    ) -> FollowOptions: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Envelope:
    """The limits of a list. A limit that is not set is not checked. Each method returns a new envelope.

    Speeds are those of the list, before the global speed. Axis limits apply to the targets of axis moves,
    the workspace to those of linear and curve moves, because the client cannot convert between them
    without a model of the arm. A value that cannot be determined counts as a violation. The envelope
    compares numbers with numbers and is no safety function.
    """

    def __new__(cls) -> Envelope: ...
    def __and__(self, other: Envelope, /) -> Envelope:
        """An envelope that a list passes only if it passes both."""
    def __rand__(self, other: Envelope, /) -> Envelope:
        """The same."""
    def speed_cap(self, cap: Percent) -> Envelope:
        """No move is faster than this."""
    def path_speed_cap(self, cap: MillimetresPerSecond) -> Envelope:
        """No path speed is higher than this."""
    def axis_limits(
        self, axis: int, lowest: Degrees | Millimetres, highest: Degrees | Millimetres
    ) -> Envelope:
        """No axis move takes this axis, 0 for J1, beyond these limits."""
    def workspace(
        self,
        lowest: tuple[Millimetres, Millimetres, Millimetres],
        highest: tuple[Millimetres, Millimetres, Millimetres],
    ) -> Envelope:
        """No linear or curve move leaves this box: X, Y, Z, in the work frame in use."""
    def largest_axis_step(self, largest: Degrees) -> Envelope:
        """No axis move turns an axis by more than this, from the present position and from target to
        target."""
    def largest_distance(self, largest: Millimetres) -> Envelope:
        """No linear or curve move ends further than this from its start."""
    def only(self, *actions: int) -> Envelope:
        """Only these actions: 4 axis move, 10 linear move, 17 curve move, 51 path speed, 52 stop on a signal,
        100 wait, 200 output, 204 outputs of a board, 800 workbench."""
    def check_motion(self, motion: Motion) -> None:
        """Raises ``OutsideEnvelope`` for the first step that violates a limit. The way from the present
        position is not checked."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __copy__(self) -> Envelope: ...
    def __deepcopy__(self, _memo: Any) -> Envelope: ...

@final
class Command:
    """A command with its arguments, in everyday units: for ``Robot.command`` (manual 4.2)."""

    @staticmethod
    def typed(word: str, *arguments: object) -> Command:
        """Any command by its word and arguments, as in ``r6 command``: ``Command.typed("modifyGSPD", 20)``.
        ``ValueError`` says which word or argument is wrong, and what it has to be."""
    @staticmethod
    def action_stop() -> Command:
        """Stops the motion at once. ``Robot.stop`` does more: it checks that the arm stands and clears its
        list."""
    @staticmethod
    def action_pause() -> Command:
        """Pauses the motion; start continues at the present step."""
    @staticmethod
    def action_single_cycle() -> Command:
        """Enters single cycle. It can set the arm in motion."""
    @staticmethod
    def start_button() -> Command:
        """The start button. It can set the arm in motion, with the rest of the list."""
    @staticmethod
    def stop_button() -> Command:
        """The stop button: the first press ends the program with the cycle, the second at once."""
    @staticmethod
    def switch_mold(mold: str) -> Command:
        """Switches to another program."""
    @staticmethod
    def modify_counter(id: int, *, current: int | None = None, target: int | None = None) -> Command:
        """Changes a counter; ``None`` keeps the value."""
    @staticmethod
    def modify_output(point: str, on: bool) -> Command:
        """Sets one output by its name: Y on boards 0 to 3, M on boards 0 to 2, EUY. A cell may start a motion
        by it."""
    @staticmethod
    def clear_alarm_run_next() -> Command:
        """Clears the alarm and runs the next step."""
    @staticmethod
    def clear_alarm_continue() -> Command:
        """Clears the alarm and continues automatically."""
    @staticmethod
    def modify_stack(stack: int, spacing: Sequence[float], count: Sequence[int]) -> Command:
        """Changes a stack: spacing in X, Y, Z, mm, and count in X, Y, Z."""
    @staticmethod
    def modify_gspd(speed: Percent) -> Command:
        """Changes the global speed."""
    @staticmethod
    def rewrite_data(register: int, value: int, *, savable: bool = False) -> Command:
        """Writes one register, 800 to 900; ``savable`` keeps it over a power cut."""
    @staticmethod
    def rewrite_data_list(first: int, values: Sequence[int], *, savable: bool = False) -> Command:
        """Writes consecutive registers."""
    @staticmethod
    def modify_acc_dec(acceleration: float, deceleration: float) -> Command:
        """Changes the acceleration and deceleration time of the path, seconds."""
    @staticmethod
    def switch_tool(tool: int) -> Command:
        """Switches to another tool; 0 means no tool."""
    @staticmethod
    def modify_tool(tool: int, offset: Sequence[float]) -> Command:
        """Changes a tool: X, Y, Z in mm and RX, RY, RZ in degrees, from the flange."""
    @staticmethod
    def switch_coordinate(workbench: int) -> Command:
        """Switches to another workbench; 0 is the world."""
    @staticmethod
    def clear_alarm() -> Command:
        """Resets and clears the alarm (207beta57)."""
    @staticmethod
    def clear_alarm_with(*, first_line: bool, only_alarm: bool) -> Command:
        """Clears the alarm as in the newest manual: whether the program goes to its first line, and whether
        only the alarm is cleared."""
    @property
    def word(self) -> str:
        """The word on the wire."""
    @property
    def meaning(self) -> str:
        """What it does."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Simulator:
    """A virtual controller on a free port of 127.0.0.1, inside this process, on its own thread.

    It listens from the start. ``close``, the end of a ``with`` block, or dropping it ends it and its
    connections.

    - ``profile``: ``"hc1"``, ``"r6-host"``, ``"r6-pendant"``, ``"legacy"``, or a file.
    - ``model``: a name of ``r6.models()``, or a file.
    - ``clock``: ``"real"``, ``"max"`` (moves take no time), ``"10x"``, or the factor as a number. At
      ``"max"`` time passes only as the program needs it: use ``"100x"`` if a time limit has to run out.
    - ``seed``: the seed of random values.
    - ``start``: ``"waiting"`` (ready for instructions), ``"auto"``, ``"manual"`` or ``"stopped"``.
    - ``program``: a program that every controller has (``"pick-and-place"``), a file, or the text of one. A
      file's program has the name of the file without its extension.
    - ``scenario``: a file, or the text of one.
    - ``cameras``: cameras that it connects to, ``"127.0.0.1:9000"`` or ``"1=127.0.0.1:9000"``.
    - ``state``: the folder that keeps what survives a power cut.

    A file is a ``pathlib.Path``, or a ``str`` that ends with ``.toml`` or ``.json``.

    Errors: ``SimulatorError`` says what is wrong. Nothing is left running then.
    """

    def __new__(
        cls,
        *,
        profile: str | PathLike[str] | None = None,
        model: str | PathLike[str] | None = None,
        clock: str | float | None = None,
        seed: int = 0,
        start: Literal["waiting", "auto", "manual", "stopped"] = "waiting",
        program: str | PathLike[str] | None = None,
        scenario: str | PathLike[str] | None = None,
        cameras: Sequence[str] = ...,
        state: str | PathLike[str] | None = None,
    ) -> Simulator: ...
    @property
    def address(self) -> str:
        """Where it listens, ``host:port``: for ``Robot.connect``."""
    @property
    def port(self) -> int:
        """The port it listens on."""
    def close(self) -> None:
        """Ends it and its connections. Raises if its state could not be written. Closing again does
        nothing."""
    def __enter__(self) -> Simulator: ...
    def __exit__(self, *_exception: object) -> None: ...
    def emergency_stop(self) -> None:
        """Presses the emergency stop, which stays pressed: alarm 7."""
    def release_emergency_stop(self) -> None:
        """Releases the emergency stop; alarm 7 stays until it is cleared."""
    def clear_alarm(self) -> None:
        """Clears the alarm; this starts nothing. Raises ``PanelRefused`` if the machine refuses."""
    def raise_alarm(self, alarm: int) -> None:
        """Raises an alarm, 1 to 10 000."""
    def press(self, button: Literal["start", "stop", "pause", "single_cycle", "single_step"]) -> None:
        """Presses a button of the pendant: ``start``, ``stop``, ``pause``, ``single_cycle``, ``single_step``."""
    def turn_key(self, key: Literal["manual", "stop", "auto"]) -> None:
        """Turns the mode key: ``manual``, ``stop``, ``auto``."""
    def home(self) -> None:
        """In manual: moves all axes to 0. The machine is homed once they are there."""
    def jog(self, axis: int, by: float, *, percent: float = 10.0) -> None:
        """In manual: moves one axis, 0 for J1, by this many degrees, or mm for a linear axis."""
    def switch_program(self, name: str) -> None:
        """Chooses another program."""
    def load_program(self, name: str, text: str) -> None:
        """Loads a program. It replaces a program with the same name."""
    def set_input(self, point: str, on: bool) -> None:
        """Sets an input, ``"X010"`` or ``"EUX010"``, from now on."""
    def is_on(self, point: str) -> bool:
        """Whether an input, output or M point is on, by its name on the pendant."""
    def request_photo(self, cam_id: int) -> None:
        """Asks a camera for a photo, as a program does."""
    def snapshot(self) -> MachineState:
        """The present state, as an operator sees it at the machine."""
    def log(self) -> list[LogLine]:
        """The events since the last call; 256 lines are kept."""

def discovering(addresses: Sequence[str], settings: RobotSettings | None = None) -> Operation[list[Discovered]]:
    """For ``discover`` and ``async_discover``."""

def word_of(name: str) -> tuple[str, int]:
    """The query address of the word that a point is a bit of, and which bit: ``("input-0", 2)`` for X012."""

def to_thousandths(value: float) -> int:
    """Converts degrees or millimetres to the value of a register, for programs that take positions from
    registers: times 1000, rounded to the nearest whole number. ``OutOfRange`` for a value that does not
    fit into the 32 bits of a register."""

def from_thousandths(value: int) -> float:
    """Converts the value of a register to degrees or millimetres."""

def alarm(code: int) -> Alarm:
    """What an alarm means and what to do about it."""

def addresses() -> list[AddressInfo]:
    """Every address that can be read, in the manual's order."""

def profiles() -> list[str]:
    """The names of the profiles that come with the package; the first is the default."""

def models() -> list[str]:
    """The names of the robot models that come with the package; the first is the default."""

def tasks() -> int:
    """The number of tasks of the engine: for tests that look for leaks."""

def ended_as_asked(core: MotionCore | FollowCore, error: BaseException) -> bool:
    """Whether the owner of this motion asked for the stop that ended it, and the arm was seen to stand."""

def told(core: MotionCore | FollowCore | None, error: BaseException, report: StopReport | BaseException) -> None:
    """Adds what became of the arm to the exception that ended the block of its motion. A ``MotionError`` of
    this motion carries the report. Any other exception gets a note. In its place this raises the error of
    a stop that failed, because nothing else would report it."""

def remade(kind: str, state: Any) -> Any:
    """Makes an object of this package again from its pickled state."""
