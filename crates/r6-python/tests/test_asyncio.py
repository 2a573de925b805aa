"""The same robot through asyncio."""

import asyncio
import inspect
import random
import sys
import threading
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from logged import commands
from relay import Relay

import r6

FAST = r6.Percent(50)
Test = Callable[[r6.AsyncRobot], Awaitable[None]]


def with_robot(controller: r6.Simulator, test: Test, settings: r6.RobotSettings | None = None) -> None:
    async def main() -> None:
        async with r6.AsyncRobot.connect(controller.address, settings) as robot:
            await test(robot)

    asyncio.run(main())


def test_the_names_are_those_of_the_other() -> None:
    for one, other in (
        (r6.Robot, r6.AsyncRobot),
        (r6.MotionHandle, r6.AsyncMotionHandle),
        (r6.Following, r6.AsyncFollowing),
        (r6.Step, r6.AsyncStep),
        (r6.Subscription, r6.AsyncSubscription),
        (r6.PushedEvents, r6.AsyncPushedEvents),
    ):
        def public(kind: type) -> set[str]:
            return {name for name in dir(kind) if not name.startswith("_")}

        assert public(one) == public(other)
        for name in public(one):
            here, there = inspect.getattr_static(one, name), inspect.getattr_static(other, name)
            if inspect.isfunction(here):
                assert list(inspect.signature(here).parameters) == list(inspect.signature(there).parameters), name


def test_reading_and_writing(virtual_controller: r6.Simulator) -> None:
    async def test(robot: r6.AsyncRobot) -> None:
        assert (await robot.query("axis-0"))["axis-0"] == 0.0
        assert (await robot.status()).is_ready and robot.address in repr(robot)
        assert await robot.firmware() == (await robot.status()).firmware
        await robot.write_registers(800, [5, 6])
        assert (await robot.read_registers(800, 2)).tolist() == [5, 6]
        await robot.set_counter(2, current=9)
        assert (await robot.counter(2)).current == 9
        await robot.set_output("Y011", True)
        assert (await robot.outputs())[1] and not (await robot.inputs()).any()
        await robot.set_global_speed(r6.Percent(60))
        assert (await robot.clear_list()).after > 0
        assert robot.link_quality().state == "alive"
        identity = robot.identity()
        assert identity is not None
        robot.accept_identity(identity)

    with_robot(virtual_controller, test)


@pytest.mark.virtual_controller(clock=10)
def test_a_motion_runs_and_tells_its_progress(virtual_controller: r6.Simulator) -> None:
    async def test(robot: r6.AsyncRobot) -> None:
        path = np.linspace([0, 0, 0, 0, 30, 0], [20, 5, 0, 0, 30, 0], 60)
        motion = r6.Motion().axis_path(path, FAST, blend=4)
        assert len(robot.dry_run(motion)) > 1
        async with await robot.run(motion) as handle:
            seen = [progress.done async for progress in handle]
            assert seen == sorted(seen) and seen[-1] == 60
            step = handle.step(60)
            assert await step.started() and await step.done() and step.state == "done"
        done = await handle.finished()
        assert np.abs(done.axes - path[-1]).max() < 0.01

    with_robot(virtual_controller, test)


def endless() -> r6.Motion:
    return r6.Motion().axis_path(np.tile([[40.0], [-40.0]], (1000, 1)), r6.Percent(5))


def test_a_cancelled_block_stops_the_arm(virtual_controller: r6.Simulator) -> None:
    async def test(robot: r6.AsyncRobot) -> None:
        moving = asyncio.Event()

        async def go() -> None:
            async with await robot.run(endless()) as handle:
                await handle.step(1).started()
                moving.set()
                await handle.finished()

        task = asyncio.create_task(go())
        await moving.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        state = virtual_controller.snapshot()
        assert not state.moving and state.list_length == 0

    with_robot(virtual_controller, test)


def test_a_block_that_fails_after_release_stops_the_arm(virtual_controller: r6.Simulator) -> None:
    async def test(robot: r6.AsyncRobot) -> None:
        with pytest.raises(ZeroDivisionError):
            async with await robot.run(endless()) as handle:
                assert await handle.step(1).started()
                handle.release()
                raise ZeroDivisionError
        state = virtual_controller.snapshot()
        assert not state.moving and state.list_length == 0

    with_robot(virtual_controller, test)


def test_errors_come_as_in_the_other(virtual_controller: r6.Simulator) -> None:
    async def test(robot: r6.AsyncRobot) -> None:
        guarded = robot.with_guard(r6.Envelope().speed_cap(r6.Percent(1)))
        with pytest.raises(r6.MotionError) as failed:
            await guarded.run(endless())
        assert failed.value.cause == "outside_envelope"
        with pytest.raises(r6.UnknownAddress):
            await robot.query("nothing")
        handle = await robot.run(endless())
        assert (await handle.stop()).confirmed
        with pytest.raises(r6.MotionError):
            await handle.finished()
        virtual_controller.press("start")
        await robot.add_rcc(r6.Motion().axis_path([[20], [-20]], r6.Percent(1)), replace=True)
        with pytest.raises(r6.WaitError):
            await robot.wait_until_done(timeout=0.2)
        assert (await robot.stop()).confirmed
        virtual_controller.press("start")
        handle = await robot.run(endless(), r6.RunOptions(stop_on_drop=True))
        handle.release()
        with pytest.raises(r6.MotionError) as dropped:
            await handle.finished()
        assert dropped.value.cause == "dropped"
        await robot.pause()
        await robot.clear_alarm()

    with_robot(virtual_controller, test)


async def given(controller: r6.Simulator, command: str) -> None:
    """Waits until the controller has done this command."""

    async def look() -> None:
        while command not in commands(controller.log()):
            await asyncio.sleep(0.01)

    await asyncio.wait_for(look(), 60)


@pytest.mark.parametrize("turns", range(3))
def test_a_stop_that_is_cancelled_early_is_sent(turns: int, virtual_controller: r6.Simulator) -> None:
    """Cancelled before the first turn of the task, and soon after."""

    async def test(robot: r6.AsyncRobot) -> None:
        handle = await robot.run(endless())
        assert await handle.step(1).started()
        stopping = asyncio.create_task(robot.stop())
        for _ in range(turns):
            await asyncio.sleep(0)
        stopping.cancel()
        with pytest.raises(asyncio.CancelledError):
            await stopping
        with pytest.raises(r6.MotionError) as failed:
            await handle.finished()
        assert failed.value.cause == "stopped_here"
        await given(virtual_controller, "actionStop")

    with_robot(virtual_controller, test)


@pytest.mark.parametrize("turns", range(3))
def test_a_pause_that_is_cancelled_early_is_sent(turns: int, virtual_controller: r6.Simulator) -> None:
    async def test(robot: r6.AsyncRobot) -> None:
        pausing = asyncio.create_task(robot.pause())
        for _ in range(turns):
            await asyncio.sleep(0)
        pausing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await pausing
        await given(virtual_controller, "actionPause")

    with_robot(virtual_controller, test)


def test_a_stop_may_be_asked_for_outside_of_a_loop(virtual_controller: r6.Simulator) -> None:
    robot = asyncio.run(r6.AsyncRobot.connect(virtual_controller.address))
    assert asyncio.run(robot.stop()).confirmed
    asyncio.run(robot.close())


SILENT = '[[fault]]\nfault = "silence"\n'


@pytest.mark.virtual_controller(scenario=SILENT)
def test_a_cancelled_request_is_dropped(virtual_controller: r6.Simulator) -> None:
    """There is no answer, so a request that was not dropped would still be waited for."""

    async def test(robot: r6.AsyncRobot) -> None:
        first = asyncio.create_task(robot.query("curMode"))
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(robot.query("curAlarm"), 0.05)
        first.cancel()
        results = await asyncio.gather(first, return_exceptions=True)
        assert isinstance(results[0], asyncio.CancelledError)

    with_robot(virtual_controller, test, r6.RobotSettings(reply_timeout=60))


def test_many_tasks_share_a_robot(virtual_controller: r6.Simulator) -> None:
    async def test(robot: r6.AsyncRobot) -> None:
        await robot.write_registers(800, list(range(40)))
        asked = [robot.read_registers(800 + number) for number in range(40)]
        assert [value.item() for value in await asyncio.gather(*asked)] == list(range(40))

    with_robot(virtual_controller, test)


@pytest.mark.parametrize("seed", range(3))
def test_tasks_cancelled_at_random_leave_the_others_their_own_values(
    seed: int, virtual_controller: r6.Simulator
) -> None:
    numbers = random.Random(seed)

    async def test(robot: r6.AsyncRobot) -> None:
        await robot.write_registers(800, list(range(60)))
        tasks: dict[asyncio.Task[npt.NDArray[np.int64]], tuple[int, int]] = {}
        cancelled = 0
        for _ in range(1000):
            first, count = numbers.randrange(50), numbers.randrange(1, 10)
            tasks[asyncio.create_task(robot.read_registers(800 + first, count))] = (first, count)
            if numbers.randrange(3) == 0:
                await asyncio.sleep(numbers.choice((0, 0, 0, 0.0005, 0.003)))
            waiting = [task for task in tasks if not task.done()]
            if waiting and numbers.randrange(3) == 0:
                cancelled += numbers.choice(waiting).cancel()
        ended = await asyncio.gather(*tasks, return_exceptions=True)
        for values, (first, count) in zip(ended, tasks.values(), strict=True):
            if isinstance(values, BaseException):
                assert isinstance(values, asyncio.CancelledError), values
            else:
                assert values.tolist() == list(range(first, first + count))
        assert 100 < sum(isinstance(values, BaseException) for values in ended) <= cancelled
        assert (await robot.status()).is_ready
        quality = robot.link_quality()
        assert (quality.timeouts, quality.reconnects) == (0, 0)

    with_robot(virtual_controller, test)


class CountingLoop(asyncio.SelectorEventLoop):
    """Counts the calls from other threads."""

    from_others = 0

    def call_soon_threadsafe(self, *given: Any, **context: Any) -> asyncio.Handle:  # type: ignore[override]
        self.from_others += 1
        return super().call_soon_threadsafe(*given, **context)


def test_a_query_needs_no_other_thread(virtual_controller: r6.Simulator) -> None:
    """Another thread helps if this process does not get its turn within 2 ms, so a busy machine may disturb
    some queries. The test looks for a hundred in a row without help. It would not find them if one query
    in ten went to another thread."""
    loop = CountingLoop()

    async def main() -> None:
        async with r6.AsyncRobot.connect(virtual_controller.address) as robot:
            await robot.query("curMode")
            alone, longest = 0, 0
            for _ in range(2000):
                before = loop.from_others
                assert (await robot.query("curMode")).integer("curMode") == 7
                alone = alone + 1 if loop.from_others == before else 0
                longest = max(longest, alone)
                if longest == 100:
                    break
            assert longest == 100

    try:
        loop.run_until_complete(main())
    finally:
        loop.close()


def test_an_event_loop_that_is_held_up_holds_up_no_heartbeat(tmp_path: Path) -> None:
    """The same while a query waits whose reply the event loop would read."""
    profile = tmp_path / "short.toml"
    profile.write_text('base = "hc1"\nheartbeat_timeout_ms = 1000\n')

    async def test(robot: r6.AsyncRobot) -> None:
        assert (await robot.status()).alarm == 0
        waiting = asyncio.create_task(robot.query("curMode"))
        await asyncio.sleep(0)
        sys.setswitchinterval(100)
        try:
            until = time.perf_counter() + 3.0
            while time.perf_counter() < until:
                pass
        finally:
            sys.setswitchinterval(0.005)
        assert (await waiting).integer("curMode") == 7
        assert (await robot.status()).alarm == 0
        assert robot.link_quality().timeouts == 0

    with r6.Simulator(profile=profile) as controller:
        with_robot(controller, test, r6.RobotSettings(heartbeat=0.1))


def test_two_loops_at_the_same_time(virtual_controller: r6.Simulator) -> None:
    async def ask(robot: r6.AsyncRobot) -> None:
        for _ in range(50):
            assert (await robot.query("curMode")).integer("curMode") == 7

    async def test(robot: r6.AsyncRobot) -> None:
        await ask(robot)
        other = threading.Thread(target=lambda: asyncio.run(ask(robot)))
        other.start()
        await ask(robot)
        await asyncio.to_thread(other.join)

    with_robot(virtual_controller, test)


def test_a_connection_that_is_made_anew_leaves_no_socket_in_the_event_loop(
    virtual_controller: r6.Simulator, relay: Relay
) -> None:
    relay.target = virtual_controller.port

    async def main() -> None:
        loop = asyncio.get_running_loop()
        watched: set[int] = set()
        add, remove = loop.add_reader, loop.remove_reader

        def add_reader(fd: int, *call: Any) -> None:
            watched.add(fd)
            add(fd, *call)

        def remove_reader(fd: int) -> bool:
            watched.discard(fd)
            return remove(fd)

        loop.add_reader = add_reader  # type: ignore[method-assign, assignment]
        loop.remove_reader = remove_reader  # type: ignore[method-assign, assignment]
        async with await r6.AsyncRobot.connect(relay.address) as robot:
            for _ in range(5):
                assert (await robot.status()).is_ready
                # While there is no connection, the engine makes one.
                await robot.query("curMode")
                assert len(watched) == 1
                relay.cut()
        for _ in range(100):
            await asyncio.sleep(0.01)
            if not watched:
                break
        assert not watched

    asyncio.run(main())


def test_subscriptions_and_events(virtual_controller: r6.Simulator) -> None:
    async def test(robot: r6.AsyncRobot) -> None:
        async with robot.subscribe("axis-0", "curMode", every=0.02) as state:
            count = 0
            async for snapshot in state:
                count += 1
                if snapshot.fresh("curMode") == 7 and count > 3:
                    break
            assert (await state.latest())["axis-0"].quality == "fresh"
            assert await state.next(timeout=5) is not None
        with pytest.raises(RuntimeError, match="closed"):
            await state.latest()
        events = robot.pushed()
        virtual_controller.request_photo(3)
        async for event in events:
            assert event == r6.Photo(cam_id=3)
            await robot.answer_photo(event)
            break
        accepted = await robot.add_points(3, [r6.Point(x=1, y=2)])
        assert accepted.points == 1
        with pytest.raises(TimeoutError):
            await events.next(timeout=0.05)

    with_robot(virtual_controller, test)


def test_two_loops_one_after_the_other(virtual_controller: r6.Simulator) -> None:
    async def connect() -> r6.AsyncRobot:
        return await r6.AsyncRobot.connect(virtual_controller.address)

    async def use(robot: r6.AsyncRobot) -> int:
        value = (await robot.query("curMode")).integer("curMode")
        await robot.close()
        return value

    assert asyncio.run(use(asyncio.run(connect()))) == 7


def test_a_connection_is_awaited_or_entered(virtual_controller: r6.Simulator) -> None:
    async def main() -> None:
        async with r6.AsyncRobot.connect(virtual_controller.address) as robot:
            assert await robot.is_on("Y010") is False
            await robot.set_output("Y010", True)
            assert (await robot.pose()).turn is not None
        task = asyncio.create_task(r6.AsyncRobot.connect(virtual_controller.address))
        second = await task
        assert await second.is_on("Y010")
        await second.close()
        host, _, port = virtual_controller.address.partition(":")
        third = await r6.AsyncRobot.connect(host, int(port))
        await third.close()

    asyncio.run(main())
