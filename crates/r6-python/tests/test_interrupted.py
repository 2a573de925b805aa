"""C in Python: a motion never loses its owner, at whatever moment a signal or a cancellation comes, and
closing does not interrupt a stop."""

import asyncio
import gc
import os
import signal
import sys
import time
from collections.abc import Awaitable, Callable
from typing import Literal

import pytest
from interrupts import GivenUp, Loop, endless, interrupted_at, stands, told, until
from logged import commands, lists
from relay import Relay
from test_process import PATH, program

import r6

Controller = r6.Simulator
NOTES = sys.version_info >= (3, 11)
"""Whether exceptions have notes."""


def start(controller: Controller) -> None:
    """Starts the program if it does not run."""
    if controller.snapshot().mode != r6.OperationMode.RUNNING:
        controller.press("start")


def begun(controller: Controller) -> bool:
    """Whether the controller got a stop since the last call."""
    return "actionStop" in commands(controller.log())


def assert_owned(error: BaseException, controller: Controller) -> None:
    """The arm stands when the exception is raised. If the arm was stopped for that, the exception says so."""
    lines = controller.log()
    assert stands(controller), f"{told(error)}: {lines}"
    if "actionStop" in commands(lines):
        assert not NOTES or "the arm stands" in told(error)
    else:
        assert not lists(lines), "it began, and nobody stopped it"


# The usual time limit uses the same signal as these tests.
@pytest.mark.timeout(method="thread")
@pytest.mark.usefixtures("alarm")
def test_a_signal_before_each_reply_to_run_leaves_no_motion_without_an_owner(
    virtual_controller: Controller, relay: Relay
) -> None:
    """The signal comes before the reply, so ``run`` has its result before Python checks for signals."""
    relay.target = virtual_controller.port
    for reply in range(1, 20):
        with r6.Robot.connect(relay.address) as robot:
            robot.status()
            virtual_controller.log()
            came, handle = 0, None

            def signal_before() -> None:
                nonlocal came
                came += 1
                if came == reply:
                    os.kill(os.getpid(), signal.SIGALRM)

            relay.before_reply = signal_before
            try:
                handle = robot.run(endless())
                relay.before_reply = None
            except GivenUp as error:
                relay.before_reply = None
                if handle is None:
                    assert_owned(error, virtual_controller)
            if handle is not None:
                handle.stop()
                break
        start(virtual_controller)
    else:
        pytest.fail("run asks fewer questions than this")


def test_no_moment_of_run_leaves_a_motion_without_an_owner(virtual_controller: Controller) -> None:
    with r6.Robot.connect(virtual_controller.address) as robot:
        for moment in range(100):
            robot.status()
            virtual_controller.log()
            try:
                with interrupted_at(moment) as was:
                    handle = robot.run(endless())
            except GivenUp as error:
                assert_owned(error, virtual_controller)
            else:
                assert not was() and moment > 0
                handle.stop()
                break
            start(virtual_controller)
        else:
            pytest.fail("it never came to an end")


@pytest.mark.parametrize("kind", ["run", "follow"])
def test_no_moment_of_a_block_leaves_a_motion_running(kind: str, virtual_controller: Controller) -> None:
    """From the first line of the block to the last line of its end, which waits for hours."""
    with r6.Robot.connect(virtual_controller.address) as robot:
        moment = 0
        while True:
            start(virtual_controller)
            robot.status()
            virtual_controller.log()
            if kind == "run":
                handle: r6.MotionHandle | r6.Following = robot.run(endless())
            else:
                handle = robot.follow(r6.FollowOptions(fresh_within=60))
                handle.target(r6.AxisPosition.degrees([80]))
            with pytest.raises(BaseException) as raised:
                with interrupted_at(moment) as was:
                    with handle:
                        if was():
                            break
                        raise ZeroDivisionError
            assert_owned(raised.value, virtual_controller)
            if isinstance(raised.value, ZeroDivisionError):
                break
            moment += 1
            assert moment < 100


WAITS = {
    "run": f"""
{PATH}
with r6.Robot.connect(address) as robot, robot.run(r6.Motion().axis_path(path, r6.Percent(5))) as moving:
    moving.step(1).started()
    waits()
""",
    "follow": """
options = r6.FollowOptions(speed=r6.Percent(0.1), largest_step=r6.Degrees(90), fresh_within=3600)
with r6.Robot.connect(address) as robot, robot.follow(options) as following:
    following.target(r6.AxisPosition.degrees([80]))
    while not robot.status().moving:
        pass
    waits()
""",
    "asyncio run": f"""
{PATH}
async def main():
    async with r6.AsyncRobot.connect(address) as robot:
        async with await robot.run(r6.Motion().axis_path(path, r6.Percent(5))) as moving:
            await moving.step(1).started()
            waits()
asyncio.run(main())
""",
    "asyncio follow": """
options = r6.FollowOptions(speed=r6.Percent(0.1), largest_step=r6.Degrees(90), fresh_within=3600)
async def main():
    async with r6.AsyncRobot.connect(address) as robot:
        async with robot.follow(options) as following:
            following.target(r6.AxisPosition.degrees([80]))
            while not (await robot.status()).moving:
                pass
            waits()
asyncio.run(main())
""",
}


@pytest.mark.parametrize("kind", WAITS)
def test_ctrl_c_at_the_end_of_a_block_stops_the_arm(kind: str, virtual_controller: Controller) -> None:
    text = f"""
import asyncio, sys, r6
address = sys.argv[1]
def waits():
    print("waiting", flush=True)
{WAITS[kind]}
"""
    with program(text, virtual_controller.address) as process:
        assert process.line() == "waiting\n"
        process.interrupt()
        said = process.end()
    assert "KeyboardInterrupt" in said
    assert stands(virtual_controller), said
    assert not NOTES or "the arm stands" in said


async def in_a_run(robot: r6.AsyncRobot, waits: asyncio.Event) -> None:
    async with await robot.run(endless()) as handle:
        assert await handle.step(1).started()
        waits.set()


async def in_a_follow(robot: r6.AsyncRobot, waits: asyncio.Event) -> None:
    options = r6.FollowOptions(speed=r6.Percent(0.1), largest_step=r6.Degrees(90), fresh_within=3600)
    async with robot.follow(options) as following:
        following.target(r6.AxisPosition.degrees([80]))
        while not (await robot.status()).moving:
            pass
        waits.set()


@pytest.mark.parametrize("block", [in_a_run, in_a_follow])
def test_a_task_that_is_cancelled_at_the_end_of_a_block_stops_the_arm(
    block: Callable[[r6.AsyncRobot, asyncio.Event], Awaitable[None]], virtual_controller: Controller
) -> None:
    async def main() -> None:
        async with r6.AsyncRobot.connect(virtual_controller.address) as robot:
            waits = asyncio.Event()

            async def called() -> BaseException:
                with pytest.raises(asyncio.CancelledError) as raised:
                    await block(robot, waits)
                return raised.value

            task = asyncio.create_task(called())
            await waits.wait()
            task.cancel()
            error = await asyncio.wait_for(task, 60)
            assert stands(virtual_controller)
            assert not NOTES or "the arm stands" in told(error)

    asyncio.run(main())


@pytest.mark.skipif(sys.version_info < (3, 11), reason="task groups are there from Python 3.11 on")
def test_a_task_group_that_cancels_a_motion_leaves_a_line_on_the_arm(
    virtual_controller: Controller, caplog: pytest.LogCaptureFixture
) -> None:
    async def main() -> None:
        async with r6.AsyncRobot.connect(virtual_controller.address) as robot:
            waits = asyncio.Event()

            async def fails() -> None:
                await waits.wait()
                raise ZeroDivisionError

            async with asyncio.TaskGroup() as group:  # type: ignore[attr-defined, unused-ignore]
                group.create_task(in_a_run(robot, waits))
                group.create_task(fails())

    with pytest.raises(BaseException) as raised:
        asyncio.run(main())
    assert [type(error) for error in raised.value.exceptions] == [ZeroDivisionError]  # type: ignore[attr-defined]
    assert stands(virtual_controller)
    lines = [record.getMessage() for record in caplog.records if record.name == "r6"]
    assert len(lines) == 1 and "the arm stands" in lines[0], lines


def on_loop(main: Callable[[Loop], Awaitable[None]]) -> None:
    """As ``asyncio.run``, on a loop that the test can disturb."""
    loop = Loop()
    try:
        loop.run_until_complete(asyncio.wait_for(main(loop), 120))
        loop.run_until_complete(loop.shutdown_asyncgens())
    finally:
        loop.close()


@pytest.mark.parametrize("when", ["early", "late"])
def test_a_run_that_is_cancelled_as_it_returns_stops_the_arm(when: Literal["early", "late"], virtual_controller: Controller) -> None:
    """The result is there, and the task has not had its turn."""

    async def main(loop: Loop) -> None:
        async with r6.AsyncRobot.connect(virtual_controller.address) as robot:
            await robot.status()
            virtual_controller.log()
            running = asyncio.ensure_future(robot.run(endless()))

            def cancel() -> None:
                loop.on_news = None
                running.cancel()

            loop.on_news = (when, cancel)
            with pytest.raises(asyncio.CancelledError) as raised:
                await running
            assert begun(virtual_controller), "it was made"
            assert stands(virtual_controller)
            assert not NOTES or "the arm stands" in told(raised.value)

    on_loop(main)


def test_a_run_that_is_cancelled_after_any_reply_has_an_owner(virtual_controller: Controller, relay: Relay) -> None:
    relay.target = virtual_controller.port

    async def main(loop: Loop) -> None:
        for reply in range(1, 20):
            async with r6.AsyncRobot.connect(relay.address) as robot:
                await robot.status()
                virtual_controller.log()
                running = asyncio.ensure_future(robot.run(endless()))
                came = 0

                def cancel() -> None:
                    nonlocal came
                    came += 1
                    if came == reply:
                        loop.call_soon_threadsafe(running.cancel)

                relay.before_reply = cancel
                try:
                    handle = await running
                except asyncio.CancelledError as error:
                    relay.before_reply = None
                    assert_owned(error, virtual_controller)
                else:
                    relay.before_reply = None
                    await handle.stop()
                    return
            start(virtual_controller)
        pytest.fail("run asks fewer questions than this")

    on_loop(main)


@pytest.mark.parametrize("turns", range(0, 60, 3))
def test_a_run_that_is_cancelled_after_any_turn_has_an_owner(turns: int, virtual_controller: Controller) -> None:
    async def main(loop: Loop) -> None:
        async with r6.AsyncRobot.connect(virtual_controller.address) as robot:
            await robot.status()
            virtual_controller.log()
            running = asyncio.ensure_future(robot.run(endless()))
            for _ in range(turns):
                # As long as a turn of a busy loop.
                time.sleep(0.001)
                await asyncio.sleep(0)
            running.cancel()
            try:
                handle = await running
            except asyncio.CancelledError as error:
                assert_owned(error, virtual_controller)
            else:
                await handle.stop()

    on_loop(main)


@pytest.mark.parametrize("when", ["early", "lost"])
def test_a_run_whose_loop_ends_stops_the_arm(when: Literal["early", "lost"], virtual_controller: Controller) -> None:
    """The result has no receiver: the loop was stopped and closed just before, or accepts nothing any
    more."""
    loop = Loop()
    robot = loop.run_until_complete(r6.AsyncRobot.connect(virtual_controller.address))
    loop.run_until_complete(robot.status())
    running = loop.create_task(robot.run(endless()))
    # The test loses a task on purpose, so the loop's report about it is not an error.
    loop.set_exception_handler(lambda loop, context: None)
    loop.on_news = (when, loop.stop)
    loop.run_forever()
    loop.close()
    del running

    def told_to_stop() -> bool:
        # The task of a closed loop is freed only by the garbage collector.
        if when == "early":
            gc.collect()
        return begun(virtual_controller)

    until("the arm was told to stop", told_to_stop)
    until("it stands", lambda: stands(virtual_controller))
    asyncio.run(robot.close())
    assert stands(virtual_controller)
