"""K1 in Python: calls that are given up at any place, by cancelling their task or by a signal. Nothing hangs,
nothing is sent or carried out twice, and the next call works."""

import asyncio
import contextlib
import json
import signal
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from types import FrameType
from typing import Any

import numpy as np
import pytest
from logged import lists
from relay import Relay

import r6

SLOW = '[[fault]]\nfault = "latency"\nto_controller = 0.1\nto_client = 0.1\n'
"""The link is slow, 5 ms each way at 20 times the speed, so that calls have to wait."""

OPTIONS = r6.RunOptions(frame_instructions=1, room=2, interval=0.02, start_within=0.1, clear_leftover=True)
STEPS = 4
REGISTER = 800


def motion(number: int) -> r6.Motion:
    """A motion whose targets no other number has, so that each must be sent at most once."""
    targets = 0.01 * (STEPS * number + np.arange(STEPS).reshape(-1, 1)) + 0.01
    return r6.Motion().axis_path(targets, r6.Percent(20))


class Witness:
    """Records what was sent, and what the controller took."""

    def __init__(self, relay: Relay, controller: r6.Simulator) -> None:
        self.relay, self.controller = relay, controller
        self.taken = 0

    def frames(self) -> list[dict[str, Any]]:
        found, text, decoder = [], bytes(self.relay.sent).decode().strip(), json.JSONDecoder()
        while text:
            frame, end = decoder.raw_decode(text)
            text = text[end:].lstrip()
            found.append(frame)
        return found

    def assert_nothing_twice(self, numbers: int) -> None:
        frames = self.frames()
        steps = [step["m0"] for frame in frames for step in frame.get("instructions", [])]
        assert max(Counter(steps).values(), default=0) <= 1, "a step left twice"
        written = [frame["cmdData"][2] for frame in frames if frame.get("cmdData", [""])[0] == "rewriteData"]
        assert max(Counter(written).values(), default=0) <= 1, "a register was written twice"
        self.taken += sum(lists(self.controller.log()))
        assert self.taken == len(steps) <= STEPS * (numbers + 1), "the controller took what left, and nothing else"
        now = self.controller.snapshot()
        assert not now.moving and now.list_length == 0 and now.alarm == 0


async def settled(robot: r6.AsyncRobot, number: int) -> None:
    """Does what a next caller does: reads the state, starts what was stopped, writes and moves."""
    await robot.write_registers(REGISTER, [number])
    # A stop goes on after its caller gave up: it may take effect after the status showed the machine running.
    handle: r6.AsyncMotionHandle | None = None
    while handle is None:
        if (await robot.status()).mode != r6.OperationMode.RUNNING:
            await robot.clear_list()
            await robot.command(r6.Command.start_button())
        with contextlib.suppress(r6.WaitError, r6.NotReady):
            await robot.wait_until_done(interval=0.02, start_within=0.05)
            handle = await robot.run(motion(number), OPTIONS)
    done = await handle.finished()
    assert done.axes[0] == pytest.approx(0.01 * STEPS * (number + 1), abs=1e-3)


async def run_to_the_end(robot: r6.AsyncRobot, number: int) -> None:
    await (await robot.run(motion(number), OPTIONS)).finished()


async def run_in_a_block(robot: r6.AsyncRobot, number: int) -> None:
    async with await robot.run(motion(number), OPTIONS) as handle:
        async for _ in handle:
            pass


async def run_step_by_step(robot: r6.AsyncRobot, number: int) -> None:
    handle = await robot.run(motion(number), OPTIONS)
    for step in range(1, STEPS + 1):
        await handle.step(step).done()


async def run_and_stop(robot: r6.AsyncRobot, number: int) -> None:
    await (await robot.run(motion(number), OPTIONS)).stop()


async def subscribe(robot: r6.AsyncRobot, number: int) -> None:
    async with robot.subscribe("axis-0", every=0.02) as state:
        for _ in range(5):
            await state.next()


async def serve(robot: r6.AsyncRobot, number: int) -> None:
    async def look(cam_id: int) -> r6.Shot:
        return "not_mine"

    await robot.serve_photos(look)


async def connect(robot: r6.AsyncRobot, number: int) -> None:
    async with r6.AsyncRobot.connect(robot.address) as other:
        await other.status()


Call = Callable[[r6.AsyncRobot, int], Awaitable[object]]
CALLS: dict[str, Call] = {
    "query": lambda robot, _: robot.query("curMode", "curAlarm"),
    "status": lambda robot, _: robot.status(),
    "write": lambda robot, number: robot.write_registers(REGISTER, [number]),
    "add_rcc": lambda robot, number: robot.add_rcc(motion(number), replace=False),
    "wait_until_done": lambda robot, _: robot.wait_until_done(),
    "stop": lambda robot, _: robot.stop(),
    "clear_list": lambda robot, _: robot.clear_list(),
    "run": lambda robot, number: robot.run(motion(number), OPTIONS),
    "run to the end": run_to_the_end,
    "run in a block": run_in_a_block,
    "run step by step": run_step_by_step,
    "run and stop": run_and_stop,
    "subscribe": subscribe,
    "serve_photos": serve,
    "connect": connect,
    "discover": lambda robot, _: r6.async_discover([robot.address]),
}

TURNS = (0, 1, 3)
"""Turns of the event loop before the cancellation: 0 is before the call has begun."""
TIMES = (0.002, 0.008, 0.015, 0.03, 0.08, 0.2)
"""Seconds before the call is given up: before the request has left, before the reply, in a motion."""


async def cancel(call: Call, robot: r6.AsyncRobot, number: int, turns: int, after: float) -> None:
    async def called() -> object:
        return await call(robot, number)

    task = asyncio.create_task(called())
    for _ in range(turns):
        await asyncio.sleep(0)
    if after > 0:
        await asyncio.sleep(after)
    task.cancel()
    await asyncio.wait([task], timeout=60)
    assert task.done(), "it hangs"
    # A call that ended before has its result; no call fails.
    assert task.cancelled() or task.exception() is None, task.exception()


@pytest.mark.virtual_controller(clock=20, scenario=SLOW)
@pytest.mark.parametrize("name", CALLS)
def test_k1_a_cancelled_task_leaves_all_in_order(
    name: str, virtual_controller: r6.Simulator, relay: Relay
) -> None:
    relay.target = virtual_controller.port
    witness = Witness(relay, virtual_controller)

    async def main() -> None:
        async with r6.AsyncRobot.connect(relay.address) as robot:
            await robot.status()
            number = 0
            for turns, after in [(turns, 0.0) for turns in TURNS] + [(0, after) for after in TIMES]:
                await cancel(CALLS[name], robot, number, turns, after)
                await asyncio.wait_for(settled(robot, number + 1), 60)
                number += 2
                witness.assert_nothing_twice(number)

    asyncio.run(main())


@pytest.mark.virtual_controller(clock=20, scenario=SLOW)
@pytest.mark.parametrize("name", ["write", "add_rcc", "run"])
def test_k1_what_is_cancelled_before_it_begins_never_leaves(
    name: str, virtual_controller: r6.Simulator, relay: Relay
) -> None:
    relay.target = virtual_controller.port
    witness = Witness(relay, virtual_controller)

    async def main() -> None:
        async with r6.AsyncRobot.connect(relay.address) as robot:
            await robot.status()
            await cancel(CALLS[name], robot, 5, 0, 0.0)
            await asyncio.wait_for(settled(robot, 0), 60)
        words = [frame.get("cmdData", [""])[-2:] for frame in witness.frames()]
        assert ["5", "0"] not in words, "it was written"
        assert sum(len(frame.get("instructions", [])) for frame in witness.frames()) == STEPS

    asyncio.run(main())


class GivenUp(Exception):
    """Raised by the signal handler, as Ctrl-C does."""


@pytest.fixture
def alarm() -> Iterator[None]:
    """A signal handler that raises at any place in the program."""

    def give_up(number: int, frame: FrameType | None) -> None:
        raise GivenUp

    before = signal.signal(signal.SIGALRM, give_up)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def finish(robot: r6.Robot, number: int) -> None:
    robot.run(motion(number), OPTIONS).finished()


def block(robot: r6.Robot, number: int) -> None:
    with robot.run(motion(number), OPTIONS) as handle:
        for _ in handle:
            pass


def watch(robot: r6.Robot, number: int) -> None:
    with robot.subscribe("axis-0", every=0.02) as state:
        for _ in range(5):
            state.next()


def time_out(robot: r6.Robot, number: int) -> None:
    """A call that times out."""
    with robot.subscribe("axis-0", every=3600) as state, pytest.raises(TimeoutError):
        for _ in range(3):
            state.next(timeout=0.02)
    with pytest.raises(TimeoutError):
        robot.pushed().next(timeout=0.02)
    robot.add_rcc(motion(number), replace=True)
    with pytest.raises(r6.WaitError):
        robot.wait_until_done(timeout=0.0)


BLOCKING: dict[str, Callable[[r6.Robot, int], object]] = {
    "query": lambda robot, _: robot.query("curMode", "curAlarm"),
    "write": lambda robot, number: robot.write_registers(REGISTER, [number]),
    "add_rcc": lambda robot, number: robot.add_rcc(motion(number), replace=False),
    "wait_until_done": lambda robot, _: robot.wait_until_done(),
    "stop": lambda robot, _: robot.stop(),
    "run": lambda robot, number: robot.run(motion(number), OPTIONS),
    "run to the end": finish,
    "run in a block": block,
    "subscribe": watch,
    "time out": time_out,
    "serve_photos": lambda robot, _: robot.serve_photos(lambda _: "not_mine"),
    "discover": lambda robot, _: r6.discover([robot.address]),
}


# The usual time limit uses the same signal as these tests.
@pytest.mark.timeout(method="thread")
@pytest.mark.usefixtures("alarm")
@pytest.mark.virtual_controller(clock=20, scenario=SLOW)
@pytest.mark.parametrize("name", BLOCKING)
def test_k1_a_blocking_call_that_is_interrupted_leaves_all_in_order(
    name: str, virtual_controller: r6.Simulator, relay: Relay
) -> None:
    relay.target = virtual_controller.port
    witness = Witness(relay, virtual_controller)
    with r6.Robot.connect(relay.address) as robot:
        robot.status()
        number = 0
        for after in TIMES:
            begun = time.monotonic()
            try:
                signal.setitimer(signal.ITIMER_REAL, after)
                BLOCKING[name](robot, number)
                signal.setitimer(signal.ITIMER_REAL, 0)
            except GivenUp:
                pass
            assert time.monotonic() - begun < 60
            asyncio.run(asyncio.wait_for(settled(r6.AsyncRobot(robot._core), number + 1), 60))
            number += 2
            witness.assert_nothing_twice(number)
