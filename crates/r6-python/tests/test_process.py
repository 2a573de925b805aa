"""Events of a process: Ctrl-C, its end, forks, other threads."""

import asyncio
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from relay import Relay

import r6

PATH = "import numpy as np; path = np.tile([[40.0], [-40.0]], (1000, 1))"


def python(program: str, *arguments: str) -> "subprocess.Popen[str]":
    """Another process that runs this program. Its last lines are its report."""
    command = [sys.executable, "-X", "faulthandler", "-c", program, *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


class Program:
    """Another process that runs a program, with one line at a time in each direction. It is killed at the end
    of its block in every case."""

    def __init__(self, text: str, *arguments: str) -> None:
        command = [sys.executable, "-X", "faulthandler", "-c", text, *arguments]
        pipe = subprocess.PIPE
        self.popen = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.STDOUT, text=True)

    def line(self) -> str:
        """The next line of its output."""
        assert self.popen.stdout is not None
        return self.popen.stdout.readline()

    def go_on(self) -> None:
        """Sends it a line."""
        assert self.popen.stdin is not None
        self.popen.stdin.write("\n")
        self.popen.stdin.flush()

    def interrupt(self) -> None:
        """Ctrl-C."""
        self.popen.send_signal(signal.SIGINT)

    def end(self) -> str:
        """Waits for its end, at most a minute, and returns the output since the last line."""
        assert self.popen.stdout is not None
        too_long = threading.Timer(60, self.popen.kill)
        too_long.start()
        # Not ``communicate``: it would lose bytes that were read together with the last line.
        said = self.popen.stdout.read()
        self.popen.wait()
        too_long.cancel()
        return said


@contextmanager
def program(text: str, *arguments: str) -> Iterator[Program]:
    """A process that runs this."""
    process = Program(text, *arguments)
    try:
        yield process
    finally:
        process.popen.kill()
        process.popen.communicate()


def interrupted(program: str, address: str) -> str:
    """The output of a program that is interrupted once it has said that it waits."""
    process = python(f"import sys, time, r6\naddress = sys.argv[1]\n{program}", address)
    assert process.stdout is not None
    assert process.stdout.readline() == "waiting\n"
    sent = time.monotonic()
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 0, said
    felt, _, said = said.partition("\n")
    # The promise is 50 ms; a busy machine may take longer. The wait itself would take hours.
    assert float(felt) - sent < 10.0
    return said


def test_ctrl_c_ends_a_wait_at_once(virtual_controller: r6.Simulator) -> None:
    said = interrupted(
        """
robot = r6.Robot.connect(address)
state = robot.subscribe("curMode", every=3600)
while state.latest()["curMode"].quality == "not_read":
    state.next()
try:
    print("waiting", flush=True)
    while True:
        state.next()
except KeyboardInterrupt:
    print(time.monotonic())
assert robot.status().is_ready
robot.close()
print("ended")
""",
        virtual_controller.address,
    )
    assert said == "ended\n"


def test_ctrl_c_in_a_block_stops_the_arm(virtual_controller: r6.Simulator) -> None:
    said = interrupted(
        f"""
{PATH}
robot = r6.Robot.connect(address)
try:
    with robot.run(r6.Motion().axis_path(path, r6.Percent(5))) as moving:
        moving.step(1).started()
        try:
            print("waiting", flush=True)
            moving.finished()
        finally:
            print(time.monotonic())
except KeyboardInterrupt as interrupt:
    print("stopped", moving.progress.ended)
    print(*getattr(interrupt, "__notes__", []))
""",
        virtual_controller.address,
    )
    stopped, note = said.splitlines()
    assert stopped == "stopped True"
    # The exception has a note, if this Python version has notes.
    assert "the arm stands" in note if sys.version_info >= (3, 11) else note == ""
    state = virtual_controller.snapshot()
    assert not state.moving and state.list_length == 0


def test_sigterm_stops_the_arm_where_it_is_made_a_ctrl_c(virtual_controller: r6.Simulator) -> None:
    process = python(
        f"""
import signal, sys, r6
signal.signal(signal.SIGTERM, signal.default_int_handler)
{PATH}
with r6.Robot.connect(sys.argv[1]) as robot, robot.run(r6.Motion().axis_path(path, r6.Percent(5))) as moving:
    moving.step(1).started()
    print("moving", flush=True)
    moving.finished()
""",
        virtual_controller.address,
    )
    assert process.stdout is not None and process.stdout.readline() == "moving\n"
    process.terminate()
    said, _ = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in said
    state = virtual_controller.snapshot()
    assert not state.moving and state.list_length == 0


def test_a_stop_that_cannot_be_sent_says_that_the_arm_was_not_stopped(virtual_controller: r6.Simulator) -> None:
    """The cable is disconnected when the block ends: the last line says what to do."""
    relay = Relay()
    relay.target = virtual_controller.port
    settings = r6.RobotSettings(connect_timeout=0.2, reply_timeout=0.2)
    path = np.tile([[40.0], [-40.0]], (1000, 1))
    with closing(relay), r6.Robot.connect(relay.address, settings) as robot:
        with pytest.raises(r6.RequestError) as failed:
            with robot.run(r6.Motion().axis_path(path, r6.Percent(5))) as moving:
                moving.step(1).started()
                relay.close()
                raise ZeroDivisionError
        # If the relay has not noticed yet, the stop may have left and its outcome is unknown.
        sent = isinstance(failed.value, r6.OutcomeUnknown)
        assert str(failed.value).startswith("the arm was NOT seen to stop" if sent else "the arm was NOT stopped")
        assert "use the emergency stop" in str(failed.value)


def test_the_stop_of_another_arm_that_failed_is_not_hidden(virtual_controller: r6.Simulator) -> None:
    """Two nested blocks: the inner motion fails and its arm is stopped; the cable of the outer arm is
    disconnected."""
    relay = Relay()
    relay.target = virtual_controller.port
    settings = r6.RobotSettings(connect_timeout=0.2, reply_timeout=0.2)
    motion = r6.Motion().axis_path(np.tile([[40.0], [-40.0]], (1000, 1)), r6.Percent(5))
    with closing(relay), r6.Simulator() as other, r6.Robot.connect(other.address) as right:
        with r6.Robot.connect(relay.address, settings) as left:
            with pytest.raises(r6.RequestError, match="the arm was NOT") as failed:
                with left.run(motion) as outer, right.run(motion) as inner:
                    outer.step(1).started()
                    inner.step(1).started()
                    relay.close()
                    other.raise_alarm(4999)
                    inner.finished()
    before = failed.value.__context__
    assert isinstance(before, r6.MotionError)
    assert isinstance(before.stop, r6.StopReport) and before.stop.confirmed, "its own arm stands"


def test_the_stop_of_another_arm_that_failed_is_not_hidden_from_asyncio(virtual_controller: r6.Simulator) -> None:
    """The test above, with tasks."""
    relay = Relay()
    relay.target = virtual_controller.port
    settings = r6.RobotSettings(connect_timeout=0.2, reply_timeout=0.2)
    motion = r6.Motion().axis_path(np.tile([[40.0], [-40.0]], (1000, 1)), r6.Percent(5))

    async def both(other: r6.Simulator) -> None:
        async with (
            await r6.AsyncRobot.connect(other.address) as right,
            await r6.AsyncRobot.connect(relay.address, settings) as left,
        ):
            async with await left.run(motion) as outer, await right.run(motion) as inner:
                await outer.step(1).started()
                await inner.step(1).started()
                relay.close()
                other.raise_alarm(4999)
                await inner.finished()

    with closing(relay), r6.Simulator() as other:
        with pytest.raises(r6.RequestError, match="the arm was NOT") as failed:
            asyncio.run(both(other))
    assert isinstance(failed.value.__context__, r6.MotionError)


@pytest.mark.virtual_controller(clock="100x")
def test_a_program_that_dies_leaves_no_more_than_its_list(virtual_controller: r6.Simulator) -> None:
    process = python(
        f"""
import sys, r6
{PATH}
robot = r6.Robot.connect(sys.argv[1])
handle = robot.run(r6.Motion().axis_path(path, r6.Percent(1)), r6.RunOptions(room=3))
handle.step(1).started()
print("moving", flush=True)
handle.finished()
""",
        virtual_controller.address,
    )
    assert process.stdout is not None and process.stdout.readline() == "moving\n"
    process.kill()
    process.communicate(timeout=60)
    left = virtual_controller.snapshot().list_length
    assert left <= 3
    with r6.Robot.connect(virtual_controller.address) as robot:
        robot.wait_until_done(timeout=60)
    assert virtual_controller.snapshot().list_length == 0


ENDINGS = {
    "open": "robot.query('curMode')",
    "moving": f"{PATH}; handle = robot.run(r6.Motion().axis_path(path, r6.Percent(5)))",
    "subscribed": "state = robot.subscribe('curMode', every=0.02); next(iter(state))",
    "iterating": "import threading; state = robot.subscribe('curMode', every=0.02)\n"
    "threading.Thread(target=lambda: [None for _ in state], daemon=True).start()",
    "simulator": "other = r6.Simulator(); second = r6.Robot.connect(other.address); second.status()",
    "asyncio": "import asyncio\nasync def main():\n    asyncio.ensure_future(robot2().status())\n"
    "def robot2():\n    return r6.AsyncRobot(robot._core)\nasyncio.run(main())",
    "late": "class Late:\n    def __init__(self):\n        self.robot = robot\n"
    "    def __del__(self):\n        self.robot.close()\nlate = Late()",
    "serving": "import threading, time\nown = r6.Simulator(); mine = r6.Robot.connect(own.address); mine.status()\n"
    "looking = threading.Event()\ndef look(cam_id):\n    looking.set()\n    time.sleep(3600)\n"
    "threading.Thread(target=mine.serve_photos, args=(look,), daemon=True).start()\n"
    "while not looking.wait(0.05): own.request_photo(1)",
    "listening": "import threading\nlisten = r6.Listen('127.0.0.1:0')\n"
    "waiting = (listen, r6.RobotSettings(connect_timeout=3600))\n"
    "threading.Thread(target=r6.Robot.connect, args=waiting, daemon=True).start()",
    "exit": "import os; sys.stdout.flush(); sys.exit(0)",
}


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_process_ends_whatever_is_open(ending: str, virtual_controller: r6.Simulator) -> None:
    program = f"import sys, r6\nrobot = r6.Robot.connect(sys.argv[1])\n{ENDINGS[ending]}\n"
    process = python(program, virtual_controller.address)
    said, _ = process.communicate(timeout=60)
    assert (process.returncode, said) == (0, "")


HURRY = """
import asyncio, sys, threading, r6
address = sys.argv[1]
robot = r6.Robot.connect(address)

def ask():
    while True:
        robot.query("curMode")

for _ in range(4):
    threading.Thread(target=ask, daemon=True).start()

async def main():
    mine = await r6.AsyncRobot.connect(address)
    for _ in range(50):
        asyncio.ensure_future(mine.query("curMode"))
    await mine.query("curMode")

asyncio.run(main())
"""


def test_the_end_of_a_process_cuts_no_thread_short(virtual_controller: r6.Simulator) -> None:
    """Threads and operations that take back the interpreter while it shuts down. Each of these cases has
    aborted some processes."""
    for _ in range(20):
        process = python(HURRY, virtual_controller.address)
        said, _ = process.communicate(timeout=60)
        assert (process.returncode, said) == (0, "")


def test_a_child_of_a_fork_connects_for_itself(virtual_controller: r6.Simulator) -> None:
    program = """
import os, sys, r6
address = sys.argv[1]
robot = r6.Robot.connect(address)
own = r6.Simulator()
handle = robot.run(r6.Motion().axis_path([[1.0]], r6.Percent(50)))
child = os.fork()
if child == 0:
    for act in (robot.status, own.snapshot, handle.finished):
        try:
            act()
        except RuntimeError as error:
            assert "forked" in str(error), error
        else:
            raise SystemExit(2)
    with r6.Robot.connect(address) as mine:
        mine.status()
    with r6.Simulator() as another, r6.Robot.connect(another.address) as mine:
        mine.status()
    del robot, own, handle
    raise SystemExit(0)
code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
handle.finished()
robot.status()
print("child", code)
"""
    process = python(program, virtual_controller.address)
    said, _ = process.communicate(timeout=60)
    assert (process.returncode, said) == (0, "child 0\n")


def test_other_threads_run_while_one_waits(virtual_robot: r6.Robot) -> None:
    """The interpreter is released: a thread that counts gets far while another waits for values."""
    counted = 0
    waiting = threading.Event()
    ended = threading.Event()

    def wait() -> None:
        with virtual_robot.subscribe("curMode", every=3600) as state:
            waiting.set()
            try:
                while True:
                    state.next(timeout=0.2)
            except TimeoutError:
                ended.set()

    thread = threading.Thread(target=wait)
    thread.start()
    waiting.wait()
    while not ended.is_set():
        counted += 1
    thread.join()
    assert counted > 1000


def test_a_thread_that_holds_the_interpreter_holds_up_no_heartbeat(tmp_path: Path) -> None:
    """The engine does not need the interpreter: if it is held for twice the time of the watchdog, no alarm
    comes."""
    profile = tmp_path / "short.toml"
    profile.write_text('base = "hc1"\nheartbeat_timeout_ms = 3000\n')
    settings = r6.RobotSettings(heartbeat=0.1)
    with r6.Simulator(profile=profile) as controller, r6.Robot.connect(controller.address, settings) as robot:
        assert robot.status().alarm == 0
        sys.setswitchinterval(100)
        try:
            until = time.perf_counter() + 6.0
            while time.perf_counter() < until:
                pass
        finally:
            sys.setswitchinterval(0.005)
        assert robot.status().alarm == 0


def test_the_watchdog_of_a_short_profile_bites(tmp_path: Path) -> None:
    """Without heartbeats the alarm comes that must not come in the test above."""
    profile = tmp_path / "short.toml"
    profile.write_text('base = "hc1"\nheartbeat_timeout_ms = 3000\n')
    with r6.Simulator(profile=profile, clock=20) as controller:
        with r6.Robot.connect(controller.address, r6.RobotSettings(heartbeat=5)) as robot:
            while robot.status().alarm == 0:
                pass
            assert robot.status().alarm == 9
