"""Objects in the child of a fork: the child gets an error at once and never hangs, whatever other threads
were doing."""

import os
import subprocess
import sys

import pytest

import r6

BUSY = """
import asyncio, gc, os, signal, sys, threading, time, r6
address = sys.argv[1]

robot = r6.Robot.connect(address)
other = r6.AsyncRobot(robot._core)
own = r6.Simulator()
neighbour = r6.Robot.connect(own.address)
moving = neighbour.run(r6.Motion().axis_path([[40.0], [-40.0]] * 200, r6.Percent(1)), r6.RunOptions(stop_on_drop=True))
state = robot.subscribe("curMode", every=0.02)
events = robot.pushed()
listen = r6.Listen("127.0.0.1:0")
photos = robot._core.serve_photos()
begun = robot._core.status().start(lambda error, value: None)
made = [robot._core.status() for _ in range(2)]

def ask():
    while True:
        robot.query("curMode", "axis-0")

def watch():
    for _ in state:
        own.log()

async def cancel():
    mine = await r6.AsyncRobot.connect(address)
    while True:
        tasks = [asyncio.ensure_future(mine.query("curMode")) for _ in range(20)]
        await asyncio.sleep(0.002)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

for work in (ask, ask, watch, lambda: asyncio.run(cancel())):
    threading.Thread(target=work, daemon=True).start()

uses = dict(
    status=robot.status,
    stop=robot.stop,
    close=robot.close,
    quality=robot.link_quality,
    guard=lambda: robot.with_guard(r6.Envelope()),
    subscribe=lambda: robot.subscribe("curMode", every=1),
    follow=robot.follow,
    serve=lambda: robot.serve_photos(lambda _: []),
    coroutine=lambda: asyncio.run(other.query("curMode")),
    stopping=lambda: asyncio.run(other.stop()),
    latest=state.latest,
    ended=state.close,
    event=events.next,
    finished=moving.finished,
    progress=lambda: moving.progress,
    release=moving.release,
    listen=lambda: r6.Robot.connect(listen),
    photo=lambda: photos.next(),
    answer=lambda: photos.answer("failed"),
    waited=made[0].wait,
    started=lambda: made[1].start(print),
    snapshot=own.snapshot,
    log=own.log,
    closed=own.close,
)

def used():
    for name, use in uses.items():
        try:
            use()
        except RuntimeError as error:
            assert "forked" in str(error), (name, error)
        else:
            raise SystemExit(f"{name} works")
    begun.cancel()

def child(number):
    # A child that hangs is killed by this, and not caught here.
    signal.alarm(60)
    at = time.monotonic()
    used()
    took = time.monotonic() - at
    assert took < 5, f"it took {took} s"
    uses.clear()
    for name in ("robot", "other", "own", "neighbour", "moving", "state", "events", "listen", "photos", "begun", "made"):
        del globals()[name]
    gc.collect()
    if number % 10 == 0:
        with r6.Robot.connect(address) as mine:
            mine.query("curMode")
        assert not isinstance(r6.discover([address])[0].who, Exception)
        asyncio.run(again())

async def again():
    async with r6.AsyncRobot.connect(address) as mine:
        await mine.query("curMode")
"""

FORKS = (
    BUSY
    + """
for number in range(60):
    pid = os.fork()
    if pid == 0:
        child(number)
        sys.exit(0)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    assert code == 0, f"child {number} ended with {code}"
robot.query("curMode")
assert not moving.progress.ended
print("forked", flush=True)
os._exit(0)
"""
)


def run(program: str, *arguments: str) -> str:
    """The output of another process, which has to end by itself."""
    command = [sys.executable, "-X", "faulthandler", "-W", "ignore::DeprecationWarning", "-c", program, *arguments]
    ended = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300)
    assert ended.returncode == 0, ended.stdout
    return ended.stdout


needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes do not fork here")


@needs_fork
def test_a_child_is_told_whatever_other_threads_do(virtual_controller: r6.Simulator) -> None:
    """Also if the child only drops the objects, and if it ends: each of these could wait for a thread that
    the child does not have."""
    assert run(FORKS, virtual_controller.address).endswith("forked\n")


IN_A_HANDLER = """
import os, signal, sys, r6
robot = r6.Robot.connect(sys.argv[1])
state = robot.subscribe("curMode", every=3600)
while state.latest()["curMode"].quality == "not_read":
    state.next()
pids = []

def fork(*_):
    pids.append(os.fork())
    if pids[-1] == 0:
        signal.alarm(60)

signal.signal(signal.SIGUSR1, fork)
signal.setitimer(signal.ITIMER_REAL, 0)
import threading
threading.Timer(0.3, os.kill, [os.getpid(), signal.SIGUSR1]).start()
try:
    state.next(timeout=3)
    raise SystemExit("it came")
except TimeoutError:
    assert pids[-1] > 0, "the child waits for its parent's robot"
except RuntimeError as error:
    assert pids[-1] == 0 and "forked" in str(error)
    sys.exit(0)
code = os.waitstatus_to_exitcode(os.waitpid(pids[-1], 0)[1])
print("child", code)
"""


@needs_fork
def test_a_child_that_a_signal_handler_forks_does_not_wait_on(virtual_controller: r6.Simulator) -> None:
    """A waiting call runs signal handlers. In the child it must not wait any longer."""
    assert run(IN_A_HANDLER, virtual_controller.address) == "child 0\n"


WORKERS = """
import multiprocessing, sys, r6

def ask(address):
    with r6.Robot.connect(address) as robot:
        return robot.query("curMode").integer("curMode")

robot = r6.Robot.connect(sys.argv[1])
robot.status()
with multiprocessing.get_context("fork").Pool(2) as pool:
    print(pool.map(ask, [robot.address] * 4))
robot.close()
"""


@needs_fork
def test_workers_that_fork_connect_for_themselves(virtual_controller: r6.Simulator) -> None:
    assert run(WORKERS, virtual_controller.address) == "[7, 7, 7, 7]\n"
