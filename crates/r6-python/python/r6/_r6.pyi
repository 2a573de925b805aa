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
]

_T = TypeVar("_T")
_T_co = TypeVar("_T_co", covariant=True)

@final
class Operation(Generic[_T_co]):
    """Something that takes time and has not begun: ``wait`` or ``start`` it, once."""

    def wait(self) -> _T_co:
        """Waits with the interpreter released. A signal handler that raises, as Ctrl-C does, ends the waiting within
        50 ms."""
    def start(
        self,
        tell: Callable[[BaseException | None, Any], object],
        event_loop: asyncio.AbstractEventLoop | None = None,
        future: asyncio.Future[Any] | None = None,
    ) -> Started:
        """Begins, and sets the result of the future of this event loop, in whose thread it is called. What the event loop does not do
        itself is done in the background, and ``tell(error, value)`` is called from another thread once it has ended."""

@final
class Started:
    """An operation that was started."""

    def cancel(self) -> None:
        """Drops what is left of it; nothing if it has ended, or goes on whatever happens, as a stop does."""
    @property
    def goes_on(self) -> str | None:
        """What to tell whoever gives up waiting, where it goes on whatever happens."""

@final
class Starting:
    """A motion on its way to its handle: from its first byte on it has an owner, the handle or a stop. Where this is dropped before
    the motion was taken, the arm is stopped."""

    UNOWNED: str
    """A note above the result of the stop: the call ended before it returned the handle of a motion that had
    begun."""
    @property
    def operation(self) -> Operation[None]:
        """What makes the motion; nothing is begun before it is."""
    def take(self) -> MotionCore:
        """The motion, once it is made."""
    def hand_over(self, handle: type[_T]) -> _T:
        """Waits until it is made, and gives its handle, which is of this class."""
    def give_up(self) -> Operation[StopReport | None] | None:
        """Stops the arm if there is a motion, taken or not: begun by the call. ``None`` if it is certain that there is none."""
    def given_up(self, error: BaseException) -> None:
        """The same, waited for whatever signals come, and told to the exception that was in the way of the handle."""

@disjoint_base
class Block(Generic[_T_co]):
    """How a motion that runs and a target that is followed end. Native, so that no signal comes between two of its lines."""

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
        """Stops the arm for an exception; waits for the end otherwise, and stops the arm if a signal interrupts that."""

@final
class RobotCore:
    """What ``Robot`` and ``AsyncRobot`` have in common."""

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
    """What ``MotionHandle`` and ``AsyncMotionHandle`` have in common."""

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
    """What ``Following`` and ``AsyncFollowing`` have in common."""

    def target(self, to: AxisPosition) -> None: ...
    def finished(self) -> Operation[Followed]: ...
    @property
    def stop_asked(self) -> bool: ...
    def stop(self) -> Operation[StopReport]: ...
    def release(self) -> None: ...

@final
class SubscriptionCore:
    """What ``Subscription`` and ``AsyncSubscription`` have in common."""

    def latest(self) -> Operation[Snapshot | None]: ...
    def next(self, timeout: float | None) -> Operation[Snapshot | None]: ...
    def close(self) -> None: ...

@final
class PushedCore:
    """What ``PushedEvents`` and ``AsyncPushedEvents`` have in common."""

    def next(self, timeout: float | None) -> Operation[Event | None]: ...

@final
class PhotosCore:
    """What ``serve_photos`` of ``Robot`` and ``AsyncRobot`` have in common."""

    def next(self) -> Operation[int | PhotosEnded]: ...
    def answer(self, shot: Shot) -> None: ...
    def close(self) -> Operation[None]: ...

@final
class Listen:
    """Waits for a controller that dials: for ``Robot.connect``.

    A port of a controller is bound to one use on its pendant, in server or in client mode. In client mode the controller
    connects to the address that is set there, again and again while nobody listens. ``address``: where to listen, such as
    ``"0.0.0.0:9760"``; with port 0 a free one is taken. ``only_from``: the IP address of the machine whose connections are
    taken; others are closed at once. There is no login: whoever reaches the port is taken for the controller, so name it.

    It serves one ``connect``, which waits for ``RobotSettings.connect_timeout`` seconds, as the robot does after a lost
    connection: give it longer than the controller takes to dial again. Of several connections that wait the newest counts.
    The port is closed with the robot, or when connecting fails.

    Errors: ``OSError`` if the port is in use or the address is none of this machine; ``ValueError``.
    """

    def __new__(cls, address: str, *, only_from: str | None = None) -> Listen: ...
    @property
    def address(self) -> str:
        """Where it listens, ``host:port``: with port 0, the one that was free."""

@final
class Progress:
    """How far a motion is, as the controller's state tells: its steps are done in their order."""

    @property
    def total(self) -> int:
        """Steps of the motion."""
    @property
    def left(self) -> int:
        """Steps that left: those that were accepted, and those of a frame whose answer is not there."""
    @property
    def accepted(self) -> int:
        """Steps that were accepted."""
    @property
    def done(self) -> int:
        """Steps that are over."""
    @property
    def ended(self) -> bool:
        """Whether nothing more is sent and nobody looks any more."""
    @property
    def current(self) -> int:
        """The step whose turn it is, counted from 1; the last one where all are over."""
    @property
    def under_way(self) -> int:
        """Steps that left and were not seen to be over."""
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
        """The same angle, full turns added or taken away, that is nearest to another: at most half a turn from it. For U, V
        and W, and for an axis that may turn on; not for one whose limits leave no choice."""
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
    """A share of the most that is possible: the speed of a move, 0.001 to 100; else ``OutOfRange``.

    An axis move at 100 % drives its slowest axis as fast as it goes; a linear move at 100 % goes 2000 mm/s (reported).
    The global speed multiplies both.
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
    """The speed of the tool along its path, before the global speed: a whole number of mm/s, 1 to 10 000, because a
    fraction raised alarm 219 (reported). A ``float`` is a ``TypeError``, any other number ``OutOfRange``."""

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
    """Which axes, by their numbers: 0 (J1) to 7 (J8)."""

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
    """Where one to eight axes are. An axis that is not named stays where it is."""

    def __new__(cls) -> AxisPosition:
        """No axis: for ``with_axis``."""
    @staticmethod
    def degrees(angles: npt.ArrayLike) -> AxisPosition:
        """J1 and the axes that follow it: 1 to 8 bare numbers, shape (n,), degrees."""
    def with_axis(self, axis: int, to: Degrees | Millimetres) -> AxisPosition:
        """The same with one axis, 0 for J1, elsewhere; ``Millimetres`` for an axis that slides."""
    def at(self, axis: int) -> Degrees | Millimetres | None:
        """Where this axis, 0 for J1, is; ``None`` if it is not named."""
    @property
    def mask(self) -> AxisMask:
        """The axes that are named."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Pose:
    """Where the tool is, in the work frame, and how it is turned; or only where.

    +180° and −180° are the same orientation and a full turn of the wrist apart: give the one that is nearer to the
    present value (``nearest_to``), or use ``position``.
    """

    def __new__(
        cls, x: Millimetres, y: Millimetres, z: Millimetres, u: Degrees, v: Degrees, w: Degrees
    ) -> Pose: ...
    @staticmethod
    def position(x: Millimetres, y: Millimetres, z: Millimetres) -> Pose:
        """X, Y, Z; the tool stays turned as it is."""
    @staticmethod
    def mm_deg(values: npt.ArrayLike) -> Pose:
        """X, Y, Z in mm, shape (3,), or X, Y, Z, U, V, W in mm and degrees, shape (6,): bare numbers."""
    def nearest_to(self, present: tuple[Degrees, Degrees, Degrees]) -> Pose:
        """The same pose with U, V and W each told as near as possible to the present ones (``world-3`` to ``world-5``). A
        real arm that read U −180 and was told +180 turned its wrist the long way round (reported). A pose without a turn
        stays as it is."""
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
    """Moves, outputs and waits in their order. Every step runs once, unless the motion repeats.

    Each method adds a step, or changes the last one, and returns the motion itself, so that a motion can be written as
    one chain. A step that is wrong raises ``StepError`` at once, and spoils the motion: nothing of it is ever sent. At
    most 100 000 steps.
    """

    def __new__(cls) -> Motion: ...
    def axis_move(self, to: AxisPosition, speed: Percent) -> Motion:
        """The axes go to this position, all arriving together (action 4)."""
    def linear_move(self, to: Pose, speed: Percent) -> Motion:
        """The tool goes straight to a pose (action 10). 100 % are 2000 mm/s (reported)."""
    def linear_move_at_path_speed(self, to: Pose) -> Motion:
        """The same at the speed that ``path_speed`` set."""
    def curve_move(self, through: Pose, to: Pose, speed: Percent) -> Motion:
        """The tool goes through a middle pose to an end (action 17). Begin with a linear move: a controller was seen to
        say ok to a curve without one, and not to go there (reported)."""
    def axis_path(self, positions: npt.ArrayLike, speed: Percent, blend: int | None = None) -> Motion:
        """An axis move to each row: shape (n, k), k from 1 to 8 axes, degrees. ``blend`` as in ``blend``, for each."""
    def linear_path(self, poses: npt.ArrayLike, speed: Percent, blend: int | None = None) -> Motion:
        """A linear move to each row: shape (n, 3), mm, or (n, 6), mm and degrees. ``blend`` as in ``blend``."""
    def blend(self, level: int) -> Motion:
        """Rounds the corner after the last step, a move: 0 stops there, 9 rounds most."""
    def delay(self, time: float) -> Motion:
        """Waits before the last step, a move: seconds, a day at most, in steps of 0.1 s."""
    def tool(self, number: int) -> Motion:
        """Makes the last step, a move, with this tool frame."""
    def work_frame(self, number: int) -> Motion:
        """Makes the last step, a move, in this work frame."""
    def path_speed(self, speed: MillimetresPerSecond) -> Motion:
        """Sets the speed of later linear moves that bring none of their own (action 51)."""
    def set_output(self, point: str, on: bool) -> Motion:
        """Sets an output of the first board, by its name on the pendant: ``"Y010"`` to ``"Y047"``, M, EUY (action 200)."""
    def pulse_output(self, point: str, on: bool, time: float) -> Motion:
        """Sets an output Y for a time, seconds, then sets it back (action 200, timed)."""
    def set_board(self, points: dict[str, bool]) -> Motion:
        """Sets many outputs of one board at once, by their names on the pendant: ``{"Y010": True, "Y017": False}``, of the
        first two boards of Y or M: ``"Y1.010"``, ``"M010"`` (action 204). Points that are not named stay as they are."""
    def wait(self, time: float) -> Motion:
        """Waits for a time, seconds, with the arm at rest (action 100)."""
    def wait_for(self, point: str, condition: Wait = "on", *, limit: float | None = None) -> Motion:
        """Waits for ``"X010"``, M or EUX, with the arm at rest: for ``limit`` seconds at most, else for ever (action 100)."""
    def stop_on_input(self, input: int, on: bool) -> Motion:
        """Lets an input, 0 to 31, stop the motion from here on when it takes a state (action 52)."""
    def workbench(self, number: int) -> Motion:
        """Changes the workbench (action 800)."""
    def extend(self, other: Motion) -> Motion:
        """Adds the steps of another motion."""
    def repeat(self) -> Motion:
        """Lets every step so far stay in the controller's list: behind the last one it starts over, until the arm is stopped. Such
        a motion has to fit into the list as a whole (``RunOptions.room``), and ``MotionHandle.finished`` ends only with an error: call
        ``MotionHandle.stop`` before the end of a ``with`` block. It goes on when this program dies, too."""
    @property
    def repeats(self) -> bool:
        """Whether a step stays in the controller's list, so that the motion never ends by itself."""
    def __len__(self) -> int:
        """How many steps there are."""
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
    """A motion out of a file as ``r6 run`` takes it: TOML (``[[instruction]]`` tables), or AddRCC frames in JSON.

    ::

        program = r6.Program.load("square.toml")
        robot.run(program.motion, r6.RunOptions(append=program.append)).finished()
    """

    @staticmethod
    def load(path: str | PathLike[str]) -> Program:
        """Reads a file of 16 MiB at most.

        Errors: ``FileError`` with every mistake, its line and its column; ``OSError`` and ``ValueError`` where it cannot be read.
        """
    @staticmethod
    def read(text: str) -> Program:
        """Reads a text that is at hand. Errors: ``FileError``."""
    @property
    def motion(self) -> Motion:
        """Its steps, as a motion of its own: what is added to it is not added to the program. It repeats if the file says so."""
    @property
    def append(self) -> bool:
        """Whether the file says that it goes behind what is in the list: for ``RunOptions.append``."""
    @property
    def remarks(self) -> list[str]:
        """What the author of the file should know: older spellings, keys that mean nothing."""
    def __len__(self) -> int: ...

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
    """What a list may ask for. What is not set is not checked. Each method returns a new envelope.

    Speeds are those of the list, before the global speed. Axis limits are held against the targets of axis moves, the
    workspace against those of linear and curve moves: without a model of the arm nobody can tell one from the other. What
    cannot be told counts as beyond. It compares numbers with numbers and is no safety function.
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
        """No axis move takes this axis, 0 for J1, further than this."""
    def workspace(
        self,
        lowest: tuple[Millimetres, Millimetres, Millimetres],
        highest: tuple[Millimetres, Millimetres, Millimetres],
    ) -> Envelope:
        """No linear or curve move leaves this box: X, Y, Z, in the work frame in use."""
    def largest_axis_step(self, largest: Degrees) -> Envelope:
        """No axis move turns an axis by more than this, from the present position and from target to target."""
    def largest_distance(self, largest: Millimetres) -> Envelope:
        """No linear or curve move ends further than this from where it begins."""
    def only(self, *actions: int) -> Envelope:
        """Only these actions: 4 axis move, 10 linear move, 17 curve move, 51 path speed, 52 stop on a signal, 100 wait,
        200 output, 204 outputs of a board, 800 workbench."""
    def check_motion(self, motion: Motion) -> None:
        """``OutsideEnvelope`` for the first step that goes beyond; the way from the present position is not looked at."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __copy__(self) -> Envelope: ...
    def __deepcopy__(self, _memo: Any) -> Envelope: ...

@final
class Command:
    """A command with its arguments, in the units of people: for ``Robot.command`` (manual 4.2)."""

    @staticmethod
    def typed(word: str, *arguments: object) -> Command:
        """Any command by its word and arguments, as ``r6 command`` takes them: ``Command.typed("modifyGSPD", 20)``.
        ``ValueError`` says which word or argument is wrong, and what it has to be."""
    @staticmethod
    def action_stop() -> Command:
        """Stops the motion at once. ``Robot.stop`` does more: it looks whether the arm stands and clears its list."""
    @staticmethod
    def action_pause() -> Command:
        """Pauses the motion; start goes on from the present step."""
    @staticmethod
    def action_single_cycle() -> Command:
        """Enters single cycle. It can set the arm in motion."""
    @staticmethod
    def start_button() -> Command:
        """The start button. It can set the arm in motion, with what is left in the list."""
    @staticmethod
    def stop_button() -> Command:
        """The stop button: the first press ends with the cycle, the second at once."""
    @staticmethod
    def switch_mold(mold: str) -> Command:
        """Switches to another program."""
    @staticmethod
    def modify_counter(id: int, *, current: int | None = None, target: int | None = None) -> Command:
        """Changes a counter; ``None`` keeps what it has."""
    @staticmethod
    def modify_output(board: int, point: int, on: bool) -> Command:
        """Sets one output: board 0–3, 4–6 M, 7 EU; point 0–31. A cell may start a motion by it."""
    @staticmethod
    def clear_alarm_run_next() -> Command:
        """Clears the alarm and runs the next step."""
    @staticmethod
    def clear_alarm_continue() -> Command:
        """Clears the alarm and goes on automatically."""
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
        """Writes registers in a row."""
    @staticmethod
    def modify_acc_dec(acceleration: float, deceleration: float) -> Command:
        """Changes the acceleration and deceleration time of the path, seconds."""
    @staticmethod
    def switch_tool(tool: int) -> Command:
        """Switches to another tool; 0 is none."""
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
        """Clears the alarm as the newest manual has it: whether the program goes to its first line, and whether only the alarm is cleared."""
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
    """A virtual controller on a free port of 127.0.0.1, inside this process, on a thread of its own.

    It listens once it is there; ``close``, the end of a ``with`` block, or dropping it ends it and its connections.
    ``profile``: ``"hc1"``, ``"r6-host"``, ``"r6-pendant"``, ``"legacy"``, or the path of a TOML file. ``model``: a name of
    ``r6.models()`` or a path. ``clock``: ``"real"``, ``"max"`` (moves take no time), ``"10x"``, or how many times as fast.
    ``seed``: of whatever is random. ``start``: ``"waiting"`` (ready for instructions), ``"auto"``, ``"manual"`` or
    ``"stopped"``. ``program``, ``scenario``: a text, or the path of a file. ``cameras``: cameras that it dials,
    ``"127.0.0.1:9000"`` or ``"1=127.0.0.1:9000"``. ``state``: the folder that keeps what survives a power cut.

    Errors: ``SimulatorError`` with what is wrong; nothing is left running then.
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
        """Ends it and its connections; raises where its state could not be written. Closing again does nothing."""
    def __enter__(self) -> Simulator: ...
    def __exit__(self, *_exception: object) -> None: ...
    def emergency_stop(self) -> None:
        """Presses the emergency stop, which stays pressed: alarm 7."""
    def release_emergency_stop(self) -> None:
        """Releases it; alarm 7 stays until it is cleared."""
    def clear_alarm(self) -> None:
        """Clears the alarm; nothing runs by itself. ``PanelRefused`` where the machine does not."""
    def raise_alarm(self, alarm: int) -> None:
        """Raises an alarm, 1 to 10 000."""
    def press(self, button: Literal["start", "stop", "pause", "single_cycle", "single_step"]) -> None:
        """Presses a button of the pendant."""
    def turn_key(self, key: Literal["manual", "stop", "auto"]) -> None:
        """Turns the mode key."""
    def home(self) -> None:
        """In manual: moves all axes to 0; the machine is homed once they are there."""
    def jog(self, axis: int, by: float, *, percent: float = 10.0) -> None:
        """In manual: moves one axis, 0 for J1, by so many degrees, or mm where it slides."""
    def switch_program(self, name: str) -> None:
        """Chooses another program."""
    def load_program(self, name: str, text: str) -> None:
        """Loads a program, in place of one with the same name."""
    def set_input(self, point: str, on: bool) -> None:
        """Sets an input, ``"X010"`` or ``"EUX010"``, from now on."""
    def is_on(self, point: str) -> bool:
        """Whether an input, output or M point is on, by its name on the pendant."""
    def request_photo(self, cam_id: int) -> None:
        """Asks a camera for a photo, as a program does."""
    def snapshot(self) -> MachineState:
        """What a person would see at the machine, now."""
    def log(self) -> list[LogLine]:
        """What has happened since the last call; 256 lines are kept."""

def discovering(addresses: Sequence[str], settings: RobotSettings | None = None) -> Operation[list[Discovered]]:
    """For ``discover`` and ``async_discover``."""

def to_thousandths(value: float) -> int:
    """Degrees or millimetres as a register has them where a program takes positions from registers: times 1000, the nearest
    whole number. ``OutOfRange`` for what does not fit into the 32 bits of a register."""

def from_thousandths(value: int) -> float:
    """A register's value in degrees or millimetres."""

def alarm(code: int) -> Alarm:
    """What an alarm means and what to do about it."""

def addresses() -> list[AddressInfo]:
    """Every address that can be read, in the manual's order."""

def profiles() -> list[str]:
    """The names of the profiles that come with the package; the first is the default."""

def models() -> list[str]:
    """The names of the robot models that come with the package; the first is the default."""

def tasks() -> int:
    """How many tasks the engine has: for tests that look for leaks."""

def ended_as_asked(core: MotionCore | FollowCore, error: BaseException) -> bool:
    """Whether the owner of this motion asked for the stop that ended it so, and the arm was seen to stand."""

def told(core: MotionCore | FollowCore | None, error: BaseException, report: StopReport | BaseException) -> None:
    """Tells the exception that ended the block of this motion what became of its arm: a ``MotionError`` of this motion carries it,
    any other has it as a line below. In place of any other a stop that failed is raised: nobody else would tell."""

def remade(kind: str, state: Any) -> Any:
    """An object of this package as it was when it was pickled."""
