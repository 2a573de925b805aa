"""Closing does not interrupt a stop. A second Ctrl-C, ``close``, the end of a block, of a loop and of the
program all wait for the stop that is under way, or say that it was not confirmed."""

import asyncio
import gc
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest
from interrupts import endless, stands, told, until
from logged import commands
from relay import Relay
from test_process import PATH, program

import r6

Controller = r6.Simulator
NOTES = sys.version_info >= (3, 11)
PATIENT = "r6.RobotSettings(reply_timeout=60)"
"""The replies are held back, and no request must time out in this time."""


@pytest.fixture
def cable(relay: Relay, virtual_controller: Controller) -> Iterator[Relay]:
    """A cable to the controller whose replies can be held back."""
    relay.target = virtual_controller.port
    yield relay
    relay.answers.set()


def stop_left(cable: Relay) -> bool:
    return b"actionStop" in cable.sent


def assert_stopped(controller: Controller) -> None:
    """Checks that the arm stands and its list is cleared, which an interrupted stop would not do."""
    lines = controller.log()
    assert stands(controller), lines
    assert "actionStop" in commands(lines)


class Closing(threading.Thread):
    """Closes a robot in its own thread."""

    def __init__(self, robot: r6.Robot) -> None:
        super().__init__(daemon=True)
        self._robot = robot
        self.start()

    def run(self) -> None:
        self._robot.close()


def test_closing_waits_for_a_stop_that_is_under_way(cable: Relay, virtual_controller: Controller) -> None:
    robot = r6.Robot.connect(cable.address, r6.RobotSettings(reply_timeout=60))
    handle = robot.run(endless())
    assert handle.step(1).started()
    cable.answers.clear()
    reports: list[r6.StopReport] = []
    stopping = threading.Thread(target=lambda: reports.append(robot.stop()), daemon=True)
    stopping.start()
    until("the stop has left", lambda: stop_left(cable))
    closing = Closing(robot)
    closing.join(0.5)
    assert closing.is_alive(), "it does not wait"
    cable.answers.set()
    stopping.join(60)
    closing.join(60)
    assert not closing.is_alive() and [report.confirmed for report in reports] == [True]
    assert_stopped(virtual_controller)


def test_closing_through_asyncio_waits_for_a_stop_whose_task_was_cancelled(
    cable: Relay, virtual_controller: Controller
) -> None:
    async def main() -> None:
        async with r6.AsyncRobot.connect(cable.address, r6.RobotSettings(reply_timeout=60)) as robot:
            handle = await robot.run(endless())
            assert await handle.step(1).started()
            cable.answers.clear()
            stopping = asyncio.ensure_future(robot.stop())
            await asyncio.sleep(0)
            stopping.cancel()
            with pytest.raises(asyncio.CancelledError) as raised:
                await stopping
            assert not NOTES or "not confirmed" in told(raised.value)
            closing = asyncio.ensure_future(robot.close())
            await asyncio.wait([closing], timeout=0.5)
            assert not closing.done(), "it does not wait"
            cable.answers.set()
            await asyncio.wait_for(closing, 60)
        assert_stopped(virtual_controller)

    asyncio.run(main())


def test_a_robot_that_nobody_holds_any_more_finishes_its_stop(cable: Relay, virtual_controller: Controller) -> None:
    async def main() -> None:
        robot = await r6.AsyncRobot.connect(cable.address, r6.RobotSettings(reply_timeout=60))
        handle = await robot.run(endless())
        assert await handle.step(1).started()
        cable.answers.clear()
        stopping = asyncio.ensure_future(robot.stop())
        await asyncio.sleep(0)
        stopping.cancel()
        await asyncio.wait([stopping])
        del robot, handle, stopping
        gc.collect()

    asyncio.run(main())
    cable.answers.set()
    until("the arm stands, and its list is empty", lambda: stands(virtual_controller))


TWICE = f"""
import signal, sys, r6
{PATH}
def felt(number, frame):
    print("felt", flush=True)
    raise KeyboardInterrupt
signal.signal(signal.SIGINT, felt)
"""

ONCE_MORE = {
    "a block": TWICE
    + f"""
with r6.Robot.connect(sys.argv[1], {PATIENT}) as robot:
    with robot.run(r6.Motion().axis_path(path, r6.Percent(5)), r6.RunOptions(room=16)) as moving:
        moving.step(1).started()
        print("moving", flush=True)
        moving.finished()
""",
    "a block at its end": TWICE
    + f"""
with r6.Robot.connect(sys.argv[1], {PATIENT}) as robot:
    with robot.run(r6.Motion().axis_path(path, r6.Percent(5)), r6.RunOptions(room=16)) as moving:
        moving.step(1).started()
        print("moving", flush=True)
""",
    "a program that does not close": TWICE
    + f"""
robot = r6.Robot.connect(sys.argv[1], {PATIENT})
moving = robot.run(r6.Motion().axis_path(path, r6.Percent(5)), r6.RunOptions(room=16))
moving.step(1).started()
try:
    print("moving", flush=True)
    moving.finished()
finally:
    robot.stop()
""",
    "asyncio": f"""
import asyncio, sys, r6
{PATH}
async def main():
    async with r6.AsyncRobot.connect(sys.argv[1], {PATIENT}) as robot:
        async with await robot.run(r6.Motion().axis_path(path, r6.Percent(5)), r6.RunOptions(room=16)) as moving:
            await moving.step(1).started()
            print("moving", flush=True)
            try:
                await moving.finished()
            finally:
                print("felt", flush=True)
asyncio.run(main())
""",
}


@pytest.mark.parametrize("kind", ONCE_MORE)
def test_a_second_ctrl_c_does_not_cut_off_the_stop_of_the_first(
    kind: str, cable: Relay, virtual_controller: Controller
) -> None:
    with program(ONCE_MORE[kind], cable.address) as process:
        assert process.line() == "moving\n"
        cable.answers.clear()
        process.interrupt()
        assert process.line() == "felt\n"
        until("the stop has left", lambda: stop_left(cable))
        process.interrupt()
        if kind != "asyncio":
            assert process.line() == "felt\n"
        cable.answers.set()
        said = process.end()
    assert "KeyboardInterrupt" in said
    assert_stopped(virtual_controller)
    # For the second Ctrl-C asyncio raises its own KeyboardInterrupt, without a note.
    assert not NOTES or kind == "asyncio" or "the arm stands" in said or "not confirmed" in said, said


def test_the_end_of_a_program_waits_for_a_stop(cable: Relay, virtual_controller: Controller) -> None:
    text = f"""
import threading, sys, r6
{PATH}
robot = r6.Robot.connect(sys.argv[1], {PATIENT})
moving = robot.run(r6.Motion().axis_path(path, r6.Percent(5)), r6.RunOptions(room=16))
moving.step(1).started()
print("moving", flush=True)
sys.stdin.readline()
threading.Thread(target=robot.stop, daemon=True).start()
sys.stdin.readline()
print("ends", flush=True)
"""
    with program(text, cable.address) as process:
        assert process.line() == "moving\n"
        cable.answers.clear()
        process.go_on()
        until("the stop has left", lambda: stop_left(cable))
        process.go_on()
        assert process.line() == "ends\n"
        with pytest.raises(subprocess.TimeoutExpired):
            process.popen.wait(0.5)
        cable.answers.set()
        said = process.end()
        assert process.popen.returncode == 0 and said == ""
        assert_stopped(virtual_controller)


def test_the_end_of_a_program_that_does_not_see_its_stop_confirmed_says_so(cable: Relay) -> None:
    """There is no answer any more; a Ctrl-C ends the wait."""
    text = f"""
import threading, sys, r6
robot = r6.Robot.connect(sys.argv[1], {PATIENT})
robot.status()
print("there", flush=True)
sys.stdin.readline()
threading.Thread(target=robot.stop, daemon=True).start()
sys.stdin.readline()
print("ends", flush=True)
"""
    with program(text, cable.address) as process:
        assert process.line() == "there\n"
        cable.answers.clear()
        process.go_on()
        until("the stop has left", lambda: stop_left(cable))
        process.go_on()
        assert process.line() == "ends\n"
        with pytest.raises(subprocess.TimeoutExpired):
            process.popen.wait(0.5)
        process.interrupt()
        said = process.end()
        assert "NOT" in said and "use the emergency stop" in said, said
