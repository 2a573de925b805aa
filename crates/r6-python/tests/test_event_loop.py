"""What an ``AsyncRobot`` uses of its event loop: sockets, turns and processor time."""

import asyncio
import gc
import selectors
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from hostile import Hostile

import r6
from r6 import _r6

WITHIN = 10.0
"""Seconds: what takes longer counts as never."""


class Loop:
    """An event loop with a selector that the test can inspect."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self.loop = asyncio.SelectorEventLoop(self._selector)
        self._own = self.watched()

    def watched(self) -> set[int]:
        """The descriptors in the selector."""
        return {key.fd for key in self._selector.get_map().values()}

    def of_robots(self) -> set[int]:
        """The same without the descriptor that wakes the loop."""
        return self.watched() - self._own


@pytest.fixture
def own() -> Iterator[Loop]:
    own = Loop()
    yield own
    own.loop.close()


async def until(what: Callable[[], bool]) -> None:
    for _ in range(int(WITHIN / 0.01)):
        if what():
            return
        await asyncio.sleep(0.01)
    raise AssertionError("it never came")


async def used(controller: r6.Simulator) -> r6.AsyncRobot:
    """A robot whose socket is in the selector."""
    robot = await r6.AsyncRobot.connect(controller.address)
    assert (await robot.query("curMode")).integer("curMode") == 7
    return robot


def test_a_robot_that_is_dropped_leaves_no_socket_in_the_event_loop(
    virtual_controller: r6.Simulator, own: Loop
) -> None:
    async def main() -> None:
        robot = await used(virtual_controller)
        assert len(own.of_robots()) == 1
        del robot

        def is_gone() -> bool:
            # If a thread of the engine lets go of the robot last, the loop removes the socket in its next turn.
            gc.collect()
            return not own.of_robots()

        await until(is_gone)

    own.loop.run_until_complete(main())


def test_a_socket_that_gets_the_number_of_a_robot_s_is_told_readable(
    virtual_controller: r6.Simulator, own: Loop
) -> None:
    async def main() -> None:
        robot = await used(virtual_controller)
        (number,) = own.of_robots()
        del robot
        gc.collect()
        pairs: list[tuple[socket.socket, socket.socket]] = []
        while not any(end.fileno() == number for pair in pairs for end in pair):
            assert len(pairs) < 100, "the socket is never closed"
            await asyncio.sleep(0.01)
            pairs.append(socket.socketpair())
        near, far = pairs[-1] if pairs[-1][0].fileno() == number else pairs[-1][::-1]
        near.setblocking(False)
        asyncio.get_running_loop().call_later(0.1, far.send, b"hello")
        assert await asyncio.wait_for(asyncio.get_running_loop().sock_recv(near, 5), WITHIN) == b"hello"
        for pair in pairs:
            for end in pair:
                end.close()

    own.loop.run_until_complete(main())


def dropped_elsewhere(robots: list[r6.AsyncRobot]) -> threading.Thread:
    """Drops the last handles in another thread."""

    def drop() -> None:
        robots.clear()
        gc.collect()

    thread = threading.Thread(target=drop)
    thread.start()
    return thread


def test_a_robot_that_is_dropped_in_another_thread_leaves_no_socket_in_the_event_loop(
    virtual_controller: r6.Simulator, own: Loop
) -> None:
    async def main() -> None:
        robots = [await used(virtual_controller)]
        thread = dropped_elsewhere(robots)
        await until(lambda: not thread.is_alive())
        # The engine ends the connection in the meantime, and the selector reports that, too.
        await until(lambda: not own.of_robots())

    own.loop.run_until_complete(main())


def test_a_connection_that_ends_after_the_robot_was_dropped_takes_its_socket_out(
    virtual_controller: r6.Simulator, own: Loop, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def main() -> None:
        robots = [await used(virtual_controller)]

        def refuse(*given: object, **context: object) -> None:
            raise RuntimeError("not told")

        with monkeypatch.context() as patched:
            patched.setattr(own.loop, "call_soon_threadsafe", refuse)
            thread = dropped_elsewhere(robots)
            thread.join()
        await until(lambda: not own.of_robots())

    own.loop.run_until_complete(main())


def test_a_robot_may_be_dropped_after_its_event_loop_was_closed(
    virtual_controller: r6.Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    unraisable: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", unraisable.append)
    robots = [asyncio.run(used(virtual_controller))]
    robots.clear()
    gc.collect()
    robots = [asyncio.run(used(virtual_controller))]
    dropped_elsewhere(robots).join()
    assert not unraisable


def test_a_robot_that_is_dropped_leaves_no_task_in_the_engine(virtual_controller: r6.Simulator) -> None:
    async def main() -> None:
        before = _r6.tasks()
        for _ in range(30):
            await used(virtual_controller)
            gc.collect()
        await until(lambda: _r6.tasks() <= before)

    asyncio.run(main())


def test_a_second_connection_leaves_no_task_in_the_engine(
    hostile: Callable[[dict[str, object]], Hostile],
) -> None:
    """A stop opens a second connection if the first does not answer."""
    controller = hostile({"deaf": [{"connection": 1, "at": 0.5}]})

    async def main() -> None:
        async with r6.AsyncRobot.connect(controller.address) as robot:
            await robot.status()
            await asyncio.sleep(1)
            before = _r6.tasks()
            for _ in range(3):
                assert (await robot.stop()).confirmed
            assert {entry["connection"] for entry in controller.ask("log")} >= {1, 2, 3, 4}
            await until(lambda: _r6.tasks() <= before)

    asyncio.run(main())


FLOOD = """
import socket, sys
listener = socket.create_server(("127.0.0.1", 0))
print(listener.getsockname()[1], flush=True)
peer, _ = listener.accept()
peer.recv(1)
flood = b"\\xff" * (1 << 20)
try:
    while True:
        peer.sendall(flood)
except OSError:
    pass
"""


@contextmanager
def peer(program: str) -> Iterator[str]:
    """Runs a controller that misbehaves in its own process, and yields its address."""
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", program], stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdout is not None
        try:
            yield f"127.0.0.1:{int(process.stdout.readline())}"
        finally:
            process.kill()


def test_a_flood_leaves_the_event_loop_its_turns() -> None:
    async def main(address: str) -> None:
        robot = await r6.AsyncRobot.connect(address, r6.RobotSettings(reply_timeout=0.5))
        longest, last = 0.0, time.perf_counter()
        end = last + 4
        asked = asyncio.create_task(robot.query("curMode"))
        while last < end:
            await asyncio.sleep(0.005)
            now = time.perf_counter()
            longest, last = max(longest, now - last), now
            if asked.done():
                assert isinstance(asked.exception(), r6.R6Error)
                asked = asyncio.create_task(robot.query("curMode"))
        asked.cancel()
        # The mean turn is below 10 ms on two cores that other programs use too.
        assert longest < 0.4

    with peer(FLOOD) as address:
        asyncio.run(main(address))


DEAF = """
import socket, sys
listener = socket.socket()
listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
listener.bind(("127.0.0.1", 0))
listener.listen()
print(listener.getsockname()[1], flush=True)
peer, _ = listener.accept()
sys.stdin.read()
"""


def test_a_peer_that_takes_nothing_costs_no_processor_time(own: Loop) -> None:
    async def main(address: str) -> None:
        robot = await r6.AsyncRobot.connect(address, r6.RobotSettings(reply_timeout=20))
        # No query, because nothing else is sent while a query is unanswered.
        photo = r6.Photo(cam_id=3)
        await robot.answer_photo(photo)
        (number,) = own.of_robots()
        with socket.fromfd(number, socket.AF_INET, socket.SOCK_STREAM) as small:
            small.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2048)
        # These wait for no reply, so they fill the buffers.
        answers = [asyncio.create_task(robot.answer_photo(photo)) for _ in range(1000)]
        await asyncio.sleep(0.5)
        before = time.process_time()
        await asyncio.sleep(2)
        spent = time.process_time() - before
        left = sum(task.done() for task in answers)
        assert 0 < left < 500, "the send buffer is full"
        for task in answers:
            task.cancel()
        # A core that is busy all the time would cost 2 s, or less if other programs use it.
        assert spent < 0.1

    with peer(DEAF) as address:
        own.loop.run_until_complete(main(address))
