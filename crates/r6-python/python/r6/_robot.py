"""A robot, for code that is not async: every call waits in its own thread, with the interpreter released."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ._errors import MotionCutShort
from ._motion import Following, MotionHandle
from ._r6 import (
    Command,
    Envelope,
    FollowOptions,
    Listen,
    Motion,
    Percent,
    Pose,
    RobotCore,
    RobotSettings,
    RunOptions,
    discovering,
    word_of,
)
from ._subscription import PushedEvents, Subscription
from ._types import (
    Accepted,
    Counter,
    Discovered,
    Done,
    Identity,
    Integers,
    LinkQuality,
    Photo,
    PhotosEnded,
    Point,
    QueryResult,
    Shot,
    Status,
    StopReport,
)

if TYPE_CHECKING:
    from typing_extensions import Self


class Robot:
    """A handle of one controller, over one connection.

    Many threads may share it. Each reply goes to the thread that asked, and a stop overtakes waiting
    requests. Errors are sorted by what to do next: see ``RequestError``. "ok" means accepted, not done.

    Ctrl-C ends a wait within 50 ms with ``KeyboardInterrupt`` and sends nothing. When this process ends in
    any way, the arm finishes the instructions that are in its list (24 at most by default). With
    ``RobotSettings(heartbeat=...)`` the controller raises an alarm 10 s after the last heartbeat.

    A stop from here is an ordinary command on a network, and no emergency stop.

    >>> with Robot.connect("192.168.1.10") as robot:        # doctest: +SKIP
    ...     print(robot.status().axes)
    """

    def __init__(self, core: RobotCore) -> None:
        """Use ``Robot.connect``."""
        self._core = connected(core)

    @classmethod
    def connect(
        cls, address: str | Listen, port: int | RobotSettings | None = None, settings: RobotSettings | None = None
    ) -> Self:
        """Connects to ``host`` or ``host:port``, port 9760 where none is given; or waits for a controller that dials
        (``Listen``). Nothing is sent.

        Errors: ``InvalidRequest`` if the text is no address, ``NotSent`` if no connection can be made
        within ``RobotSettings.connect_timeout``.
        """
        return cls(RobotCore.connect(*target(address, port, settings)).wait())

    @property
    def address(self) -> str:
        """Host and port of the controller. With ``Listen``, the address where this program waits for it."""
        return self._core.address

    def close(self) -> None:
        """Closes the connection for all its handles. Waits for a stop that is under way. Closing again does
        nothing.

        A motion that is still being streamed ends here: the arm finishes the instructions in the
        controller's list. With ``RunOptions.stop_on_drop`` the arm is stopped first. A ``MotionCutShort``
        warning says so, unless ``finished`` or ``wait_until_done`` has reported it. Wait for the end of
        the motion before closing.

        Closing takes at most half a second. If an arm is being stopped, closing waits for that: at most 15
        s, and 15 s more for the stop of a streamed motion. If that fails, the connection ends all the
        same: call ``stop`` yourself if you have to know. Ctrl-C ends the wait; the closing goes on.
        """
        cut_short(self._core.close().wait())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        cut_short(self._core.close().wait())

    def query(self, *addresses: str) -> QueryResult:
        """Reads the values of these addresses (``r6.addresses`` lists them): ``robot.query("axis-0",
        "curMode")``.

        A long list is split. If a reply has fewer values than were asked for, the client asks again in
        smaller and smaller parts, so that a value is never taken for another one.

        Errors: ``UnknownAddress``; ``RequestError``.
        """
        return self._core.query(*addresses).wait()

    def status(self) -> Status:
        """The state of the machine, with the conditions that keep it from taking instructions (``unmet``).

        After a reconnection this also lets commands through again. Errors: ``RequestError``.
        """
        return self._core.status().wait()

    def firmware(self) -> str | None:
        """The firmware's version, asked for once per connection; ``None`` if it reports no version. Errors:
        ``RequestError``."""
        return self._core.firmware().wait()

    def command(self, command: Command) -> Accepted:
        """Sends a command. The client never resends it. Errors: ``RequestError``."""
        return self._core.command(command).wait()

    def pose(self) -> Pose:
        """The pose of the tool in use, in the work frame in use: mm and degrees.

        Errors: ``NoReading``; ``RequestError``.
        """
        return pose(self.query(*WORLD))

    def start(self) -> Accepted:
        """Presses start (``startButton``): the program runs, and the arm may move. "ok" comes before anything runs.

        Errors: ``RequestError``.
        """
        return self.command(Command.start_button())

    def pause(self) -> Accepted:
        """Pauses the motion, ahead of waiting requests (``actionPause``). Errors: ``RequestError``."""
        return self.command(Command.action_pause())

    def clear_alarm(self) -> Accepted:
        """Resets and clears the alarm (``clearAlarm``, firmware 207beta57 and later). Errors:
        ``RequestError``."""
        return self.command(Command.clear_alarm())

    def set_global_speed(self, speed: Percent) -> Accepted:
        """Sets the global speed, which multiplies every move. Errors: ``RequestError``."""
        return self.command(Command.modify_gspd(speed))

    def set_output(self, point: str, on: bool) -> Accepted:
        """Sets an output by its name on the pendant: ``robot.set_output("Y010", True)``. Y on boards 0 to 3 (``Y1.010``), M on
        boards 0 to 2, EUY. A cell may start a motion by it.

        Errors: ``ValueError`` for a point that no command sets; ``RequestError``.
        """
        return self.command(Command.modify_output(point_name(point), on))

    def is_on(self, point: str) -> bool:
        """Whether an input, output or M point is on: ``robot.is_on("X010")``.

        Errors: ``ValueError`` for EU points, which no query address tells; ``NoReading``; ``RequestError``.
        """
        address, bit = word_of(point_name(point))
        return bool(self.query(address).integer(address) >> bit & 1)

    def inputs(self, board: int = 0) -> npt.NDArray[np.bool_]:
        """The 32 inputs of a board: shape (32,). Errors: ``NoReading``; ``RequestError``."""
        return points(self.query(f"input-{board}").integer(f"input-{board}"))

    def outputs(self, board: int = 0) -> npt.NDArray[np.bool_]:
        """The 32 outputs of a board: shape (32,). Errors: ``NoReading``; ``RequestError``."""
        return points(self.query(f"output-{board}").integer(f"output-{board}"))

    def counter(self, id: int) -> Counter:
        """A counter. Errors: ``NoReading`` if there is no such counter; ``RequestError``."""
        return counter(self.query(f"counter-{id}"), id)

    def set_counter(self, id: int, *, current: int | None = None, target: int | None = None) -> Accepted:
        """Changes a counter; ``None`` keeps the value. Errors: ``RequestError``."""
        return self.command(Command.modify_counter(id, current=current, target=target))

    def read_registers(self, first: int, count: int = 1) -> Integers:
        """The values of consecutive registers, 800 to 900: int64, shape (count,). Errors: ``NoReading``;
        ``RequestError``."""
        return self._core.read_registers(first, count).wait()

    def write_registers(
        self, first: int, values: Sequence[int] | Integers, *, savable: bool = False, verify: bool = True
    ) -> None:
        """Writes consecutive registers, 800 to 900: signed whole numbers of 32 bits. This may start a motion
        in a cell.

        ``savable`` keeps them over a power cut. ``verify`` reads them back, because controllers answer ok
        to values that they do not take. Errors: ``NotTaken``; ``RequestError``.
        """
        self._core.write_registers(first, whole(values), savable=savable, verify=verify).wait()

    def run(self, motion: Motion, options: RunOptions | None = None) -> MotionHandle:
        """Runs a motion: checks it, checks the machine, then streams it in lists that the controller accepts.

        It returns once everything is checked; the handle reports what happens then. A list whose outcome
        is unknown is never sent again: the motion ends there.

        If a signal handler raises before the caller has the handle (Ctrl-C does), the arm is stopped,
        verified, and its list cleared. The exception then has a note with the result (Python 3.11).

        Errors: ``NotReady`` with the unmet conditions; ``MotionError`` for a wrong step, a step outside
        the guard's envelope, another motion that is being streamed, or a state that cannot be read.
        Nothing was sent then.
        """
        starting = self._core.run(motion, options)
        try:
            return starting.hand_over(MotionHandle)
        except BaseException as error:
            # Native code, so that no other signal handler runs in between.
            starting.given_up(error)
            raise

    def follow(self, options: FollowOptions | None = None) -> Following:
        """Follows a moving target. Call ``Following.target`` repeatedly with its position. It begins at once;
        nothing moves before the first target.

        ::

            with robot.follow() as following:
                for position in positions():                # a source of yours, 20 times a second
                    following.target(position)
            print(following.finished().behind)

        **A target counts for half a second** (``FollowOptions.fresh_within``), the last one too. For the
        arm to arrive, send the target again until ``status()`` or ``Followed.behind`` shows that the arm
        is there. Whether the arm can reach a target is not checked: it goes towards the target in steps,
        up to its soft limits.

        Each time the arm is ready for another step, the newest target counts; older ones are skipped. A
        step is never sent again. Nothing more is sent once targets are no longer fresh, the state cannot
        be read, or a handle of this connection sends a stop. ``Following`` reports the error, including
        ``NotReady`` at the beginning.
        """
        return Following(self._core.follow(options))

    def dry_run(self, motion: Motion, options: RunOptions | None = None) -> list[bytes]:
        """The frames that ``run`` would send, exact except for ``packID``. Nothing is sent.

        Errors: ``StepError``; ``OutsideEnvelope``.
        """
        return self._core.dry_run(motion, options)

    def add_rcc(self, motion: Motion, *, replace: bool) -> Accepted:
        """Sends a motion as one list, which replaces the present list or is appended: for code that does not
        use ``run``.

        Errors: ``RequestError``. A list longer than ``RobotSettings.max_frame_bytes`` is not sent.
        """
        return self._core.add_rcc(motion, replace).wait()

    def wait_until_done(
        self,
        *,
        timeout: float = 60.0,
        interval: float = 0.05,
        settle: float = 0.5,
        start_within: float = 1.0,
        idle_mode: int = 7,
    ) -> Done:
        """Reads the state until the arm stands and the list is done, at most ``timeout`` seconds.

        - ``interval``: the pause between two reads, seconds; 0 reads as fast as answers come.
        - ``settle``: how long the arm has to stand if the controller cannot report the length of its list,
          seconds.
        - ``start_within``: how long it may take to begin to move, seconds.
        - ``idle_mode``: the mode in which this controller waits for instructions.

        Errors: ``WaitError``.
        """
        return self._core.wait_until_done(timeout, interval, settle, start_within, idle_mode).wait()

    def stop(self) -> StopReport:
        """Stops the motion, ahead of waiting requests, until the arm is seen to stand, at most 5 s; then
        clears the list.

        A motion that is being streamed over this connection ends. Ctrl-C ends the wait, not the stop:
        ``close`` and the end of the program wait for it, at most 15 s. The program reports a stop that was
        not confirmed.

        Errors: ``RequestError`` if no stop was answered at all. Check ``StopReport.confirmed``.
        """
        return self._core.stop().wait()

    def clear_list(self) -> Accepted:
        """Empties the instruction list, so that no old instruction runs at the next start. Errors:
        ``RequestError``."""
        return self._core.clear_list().wait()

    def subscribe(self, *addresses: str, every: float) -> Subscription:
        """Reads these addresses every ``every`` seconds, 0.02 to 3600, until the subscription is closed or
        dropped.

        All subscriptions of a robot share one poller. After a lost connection the next poll reconnects.

        Errors: ``UnknownAddress``; ``NotSubscribed``.
        """
        return Subscription(self._core.subscribe(addresses, every))

    def pushed(self) -> PushedEvents:
        """Events on the connection, from now on: photo requests, strays, losses.

        A reader that is more than 64 events behind misses the oldest, and learns how many.
        """
        return PushedEvents(self._core.pushed())

    def answer_photo(self, photo: Photo, *, taken: bool = True) -> None:
        """Answers a photo request. The controller does not reply. Errors: ``RequestError``."""
        self._core.answer_photo(photo.cam_id, taken).wait()

    def add_points(self, cam_id: int, points: Sequence[Point]) -> Accepted:
        """Sends the points that a camera found. ``Accepted.points`` is the number of accepted points. Errors:
        ``RequestError``."""
        return self._core.add_points(cam_id, points).wait()

    def serve_photos(self, look: Callable[[int], Shot]) -> PhotosEnded:
        """Serves as the camera of this controller. Calls ``look`` with the camera's number for each photo
        request, answers the request, and sends the points that were found: X, Y, Z in mm and angles in
        degrees.

        ::

            def look(cam_id: int) -> r6.Shot:
                return [r6.Point(x=400.0, y=-40.0, z=450.0, angle=90.0)]   # or "failed", or "not_mine"

            print(robot.serve_photos(look))

        It keeps this thread until it cannot continue, and returns the reason. Requests are served one
        after the other. ``look`` may take time and may use this robot: stops of other threads, heartbeats
        and motions do not wait for it. A connection has one camera service: a second call ends at once
        with ``served_already``.

        These end the serving at once, and the request then gets no answer:

        - An exception of ``look``, or Ctrl-C. It is raised here.
        - A result that is no ``Shot``: ``TypeError`` or ``ValueError``.
        - Points that cannot be sent (NaN, or too many for a frame): ``reason`` is ``request``. An answer
          would promise them.

        A program waits for the answer for its own time. If finding takes longer than taking the picture,
        use ``pushed``, ``answer_photo`` and ``add_points``. Points can set the arm in motion, and no guard
        checks them. So no points are sent if this connection sent a stop or a pause while their picture
        was under way. Nothing that failed is sent again. Requests that come before this call are not seen.
        """
        serving = self._core.serve_photos()
        try:
            while not isinstance(asked := serving.next().wait(), PhotosEnded):
                serving.answer(look(asked))
        finally:
            serving.close().wait()
        return asked

    def link_quality(self) -> LinkQuality:
        """The quality of the connection. Nothing is sent."""
        return self._core.link_quality()

    def identity(self) -> Identity | None:
        """The identity of the controller; ``None`` before anything was read. Nothing is sent."""
        return self._core.identity()

    def accept_identity(self, found: Identity) -> None:
        """Accepts this controller as the intended one, after ``NotSent`` with ``another_robot``: a cabinet
        was exchanged, its firmware updated, or its machine renamed."""
        self._core.accept_identity(found)

    def guard(self) -> Envelope | None:
        """The envelope that this handle checks against."""
        return self._core.guard()

    def with_guard(self, envelope: Envelope) -> Self:
        """The same robot behind a guard: each motion of the new handle is checked against the envelope first,
        and not sent if it exceeds a limit. Commands are not checked. Both handles share one connection:
        closing either ends it for both."""
        return type(self)(self._core.with_guard(envelope))

    def __repr__(self) -> str:
        return f"<Robot at {self.address}>"


def discover(addresses: Sequence[str], settings: RobotSettings | None = None) -> list[Discovered]:
    """Asks at these addresses, ``host`` or ``host:port``, which controller answers. Returns one
    ``Discovered`` for each, in order. It only reads, over one connection to each address that is closed
    properly. No heartbeat is sent, whatever the settings say.

    Name the addresses where controllers may be, and the ports that their pendants may be set to (9760;
    others were seen on 9700, 502, 503, 3388 and 8888). Do not scan a network: controllers have very few
    connections, and a half-open one can make the port useless until the controller is switched off and on
    (reported). An address that another program is connected to may not answer.

    Errors: none; why an address did not answer is in its ``Discovered.who``.

    >>> for found in discover(["192.168.1.10", "192.168.1.11:9700"]):        # doctest: +SKIP
    ...     print(found.address, found.who)
    """
    return discovering(addresses, settings).wait()


def target(
    address: str | Listen, port: int | RobotSettings | None, settings: RobotSettings | None
) -> tuple[str | Listen, RobotSettings | None]:
    """Where to connect, and how: ``connect("host", 9760)``, ``connect("host:9760")``, ``connect("host", settings)``."""
    if isinstance(port, RobotSettings):
        if settings is not None:
            raise TypeError("the settings were given twice")
        return address, port
    if port is None:
        return address, settings
    if isinstance(port, bool) or not isinstance(port, int) or not isinstance(address, str):
        raise TypeError(f'write connect("192.168.1.10", 9760) or connect("192.168.1.10:9760"), not {address!r}, {port!r}')
    if address.count(":") == 1 or "]:" in address:
        raise ValueError(f"the port was given twice: {address!r} and {port}")
    bare = f"[{address}]" if ":" in address and not address.startswith("[") else address
    return f"{bare}:{port}", settings


def cut_short(motion: str | None) -> None:
    """Warns about a motion that closing ended, at the line that closes."""
    if motion is not None:
        warnings.warn(MotionCutShort(motion), stacklevel=3)


def connected(core: RobotCore) -> RobotCore:
    """Checks that this is a result of ``connect``, because many users try an address first."""
    if not isinstance(core, RobotCore):
        raise TypeError(f"a robot is made by connecting: Robot.connect({core!r}), or await AsyncRobot.connect({core!r})")
    return core


def points(word: int) -> npt.NDArray[np.bool_]:
    """The 32 points of a word, lowest bit first: shape (32,)."""
    return (word >> np.arange(32, dtype=np.int64) & 1).astype(np.bool_)


WORLD = tuple(f"world-{component}" for component in range(6))


def pose(result: QueryResult) -> Pose:
    """The pose that was asked for."""
    return Pose.mm_deg([result.number(component) for component in WORLD])


def point_name(point: str) -> str:
    """The name of a point; ``TypeError`` with what to write for a number."""
    if not isinstance(point, str):
        raise TypeError(f'a point goes by its name on the pendant, such as "Y010" or "X1.012", not {point!r}')
    return point


def counter(result: QueryResult, id: int) -> Counter:
    """The counter that was asked for."""
    found = result[f"counter-{id}"]
    assert isinstance(found, Counter), "the value of a counter's address is a counter"
    return found


def whole(values: Sequence[int] | Integers) -> list[int]:
    """Converts whole numbers to Python's ``int``; ``TypeError`` for others."""
    array = np.asarray(values)
    if array.dtype.kind not in "iu":
        raise TypeError(f"registers hold whole numbers, not {array.dtype}")
    numbers: list[int] = array.ravel().tolist()
    return numbers
