"""A robot for asyncio: the same names as in ``Robot``, which documents them."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Coroutine, Generator, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt

from ._async_motion import AsyncFollowing, AsyncMotionHandle
from ._async_subscription import AsyncPushedEvents, AsyncSubscription
from ._asyncio import run, run_at_once, told_to
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
from ._robot import WORLD, connected, counter, cut_short, point_name, points, pose, target, whole
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


_R = TypeVar("_R", bound="AsyncRobot")


class Connecting(Coroutine[Any, Any, _R]):
    """What ``AsyncRobot.connect`` returns: a coroutine, which ``async with`` can also enter. It closes the robot at its end."""

    def __init__(self, connecting: Coroutine[Any, Any, _R]) -> None:
        """``AsyncRobot.connect`` makes it."""
        self._connecting = connecting
        self._robot: _R | None = None

    def __await__(self) -> Generator[Any, None, _R]:
        return self._connecting.__await__()

    def send(self, value: Any, /) -> Any:
        """As that of a coroutine."""
        return self._connecting.send(value)

    def throw(self, *error: Any) -> Any:
        """As that of a coroutine."""
        return self._connecting.throw(*error)

    def close(self) -> None:
        """As that of a coroutine."""
        self._connecting.close()

    async def __aenter__(self) -> _R:
        self._robot = await self._connecting
        return self._robot

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._robot is not None:
            # Not by its own __aexit__: the warning is about the line of the caller.
            cut_short(await run(self._robot._core.close()))


class AsyncRobot:
    """A handle of one controller, over one connection: ``Robot`` for asyncio.

    Many tasks, and many event loops, may use one handle. Cancelling a call withdraws its request if it has
    not left yet. A stop and a pause cannot be withdrawn, because the call itself begins them. Calls that
    do not wait are no coroutines: ``subscribe``, ``pushed``, ``dry_run``, ``link_quality``, ``identity``,
    ``accept_identity``, ``guard``, ``with_guard``, ``follow``.

    >>> async with AsyncRobot.connect("192.168.1.10") as robot:        # doctest: +SKIP
    ...     print((await robot.status()).axes)
    """

    def __init__(self, core: RobotCore) -> None:
        """Use ``AsyncRobot.connect``."""
        self._core = connected(core)

    @classmethod
    def connect(
        cls, address: str | Listen, port: int | RobotSettings | None = None, settings: RobotSettings | None = None
    ) -> Connecting[Self]:
        """As ``Robot.connect``. Write ``robot = await AsyncRobot.connect(...)`` or ``async with AsyncRobot.connect(...) as robot:``."""
        where, how = target(address, port, settings)

        async def connect() -> Self:
            return cls(await run(RobotCore.connect_async(where, how)))

        return Connecting(connect())

    @property
    def address(self) -> str:
        """As ``Robot.address``."""
        return self._core.address

    async def close(self) -> None:
        """As ``Robot.close``."""
        cut_short(await run(self._core.close()))

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        cut_short(await run(self._core.close()))

    async def query(self, *addresses: str) -> QueryResult:
        """As ``Robot.query``."""
        return await run(self._core.query(*addresses))

    async def status(self) -> Status:
        """As ``Robot.status``."""
        return await run(self._core.status())

    async def firmware(self) -> str | None:
        """As ``Robot.firmware``."""
        return await run(self._core.firmware())

    async def command(self, command: Command) -> Accepted:
        """As ``Robot.command``."""
        return await run(self._core.command(command))

    async def pose(self) -> Pose:
        """As ``Robot.pose``."""
        return pose(await self.query(*WORLD))

    async def start(self) -> Accepted:
        """As ``Robot.start``."""
        return await self.command(Command.start_button())

    def pause(self) -> Coroutine[Any, Any, Accepted]:
        """As ``Robot.pause``. The call itself sends it, so that cancelling its task, however early, does not
        withdraw it."""
        return run_at_once(self._core.command(Command.action_pause()))

    async def clear_alarm(self) -> Accepted:
        """As ``Robot.clear_alarm``."""
        return await self.command(Command.clear_alarm())

    async def set_global_speed(self, speed: Percent) -> Accepted:
        """As ``Robot.set_global_speed``."""
        return await self.command(Command.modify_gspd(speed))

    async def set_output(self, point: str, on: bool) -> Accepted:
        """As ``Robot.set_output``."""
        return await self.command(Command.modify_output(point_name(point), on))

    async def is_on(self, point: str) -> bool:
        """As ``Robot.is_on``."""
        address, bit = word_of(point_name(point))
        return bool((await self.query(address)).integer(address) >> bit & 1)

    async def inputs(self, board: int = 0) -> npt.NDArray[np.bool_]:
        """As ``Robot.inputs``: shape (32,)."""
        return points((await self.query(f"input-{board}")).integer(f"input-{board}"))

    async def outputs(self, board: int = 0) -> npt.NDArray[np.bool_]:
        """As ``Robot.outputs``: shape (32,)."""
        return points((await self.query(f"output-{board}")).integer(f"output-{board}"))

    async def counter(self, id: int) -> Counter:
        """As ``Robot.counter``."""
        return counter(await self.query(f"counter-{id}"), id)

    async def set_counter(
        self, id: int, *, current: int | None = None, target: int | None = None
    ) -> Accepted:
        """As ``Robot.set_counter``."""
        return await self.command(Command.modify_counter(id, current=current, target=target))

    async def read_registers(self, first: int, count: int = 1) -> Integers:
        """As ``Robot.read_registers``: int64, shape (count,)."""
        return await run(self._core.read_registers(first, count))

    async def write_registers(
        self, first: int, values: Sequence[int] | Integers, *, savable: bool = False, verify: bool = True
    ) -> None:
        """As ``Robot.write_registers``."""
        await run(self._core.write_registers(first, whole(values), savable=savable, verify=verify))

    async def run(self, motion: Motion, options: RunOptions | None = None) -> AsyncMotionHandle:
        """As ``Robot.run``. If the task is cancelled before it has the handle, it ends once the arm is
        stopped."""
        starting = self._core.run(motion, options)
        try:
            await run(starting.operation)
            return AsyncMotionHandle(starting.take())
        except BaseException as error:
            stopping = starting.give_up()
            if stopping is not None:
                await told_to(error, None, stopping, starting.UNOWNED)
            raise

    def follow(self, options: FollowOptions | None = None) -> AsyncFollowing:
        """As ``Robot.follow``."""
        return AsyncFollowing(self._core.follow(options))

    def dry_run(self, motion: Motion, options: RunOptions | None = None) -> list[bytes]:
        """As ``Robot.dry_run``."""
        return self._core.dry_run(motion, options)

    async def add_rcc(self, motion: Motion, *, replace: bool) -> Accepted:
        """As ``Robot.add_rcc``."""
        return await run(self._core.add_rcc(motion, replace))

    async def wait_until_done(
        self,
        *,
        timeout: float = 60.0,
        interval: float = 0.05,
        settle: float = 0.5,
        start_within: float = 1.0,
        idle_mode: int = 7,
    ) -> Done:
        """As ``Robot.wait_until_done``."""
        return await run(self._core.wait_until_done(timeout, interval, settle, start_within, idle_mode))

    def stop(self) -> Coroutine[Any, Any, StopReport]:
        """As ``Robot.stop``. The call itself begins it. Cancelling its task, however early, ends the wait and
        not the stop."""
        return run_at_once(self._core.stop())

    async def clear_list(self) -> Accepted:
        """As ``Robot.clear_list``."""
        return await run(self._core.clear_list())

    def subscribe(self, *addresses: str, every: float) -> AsyncSubscription:
        """As ``Robot.subscribe``."""
        return AsyncSubscription(self._core.subscribe(addresses, every))

    def pushed(self) -> AsyncPushedEvents:
        """As ``Robot.pushed``."""
        return AsyncPushedEvents(self._core.pushed())

    async def answer_photo(self, photo: Photo, *, taken: bool = True) -> None:
        """As ``Robot.answer_photo``."""
        await run(self._core.answer_photo(photo.cam_id, taken))

    async def add_points(self, cam_id: int, points: Sequence[Point]) -> Accepted:
        """As ``Robot.add_points``."""
        return await run(self._core.add_points(cam_id, points))

    async def serve_photos(self, look: Callable[[int], Awaitable[Shot]]) -> PhotosEnded:
        """As ``Robot.serve_photos``, with an awaitable ``look``. For a slow function, make one with
        ``asyncio.to_thread``. If a stop or a lost connection ends the serving while it looks, ``look`` is
        cancelled."""
        serving = self._core.serve_photos()
        coming = asyncio.ensure_future(run(serving.next()))
        try:
            while not isinstance(asked := await coming, PhotosEnded):
                coming = asyncio.ensure_future(run(serving.next()))
                looking = asyncio.ensure_future(look(asked))
                try:
                    # `coming` is the end of the serving, because no other request comes before this one is answered.
                    await asyncio.wait({looking, coming}, return_when=asyncio.FIRST_COMPLETED)
                    if looking.done():
                        serving.answer(looking.result())
                finally:
                    looking.cancel()
        finally:
            coming.cancel()
            await run(serving.close())
        return asked

    def link_quality(self) -> LinkQuality:
        """As ``Robot.link_quality``."""
        return self._core.link_quality()

    def identity(self) -> Identity | None:
        """As ``Robot.identity``."""
        return self._core.identity()

    def accept_identity(self, found: Identity) -> None:
        """As ``Robot.accept_identity``."""
        self._core.accept_identity(found)

    def guard(self) -> Envelope | None:
        """As ``Robot.guard``."""
        return self._core.guard()

    def with_guard(self, envelope: Envelope) -> Self:
        """As ``Robot.with_guard``."""
        return type(self)(self._core.with_guard(envelope))

    def __repr__(self) -> str:
        return f"<AsyncRobot at {self.address}>"


async def async_discover(
    addresses: Sequence[str], settings: RobotSettings | None = None
) -> list[Discovered]:
    """As ``discover``, for asyncio."""
    return await run(discovering(addresses, settings))
