"""Values of a subscription, and events."""

import asyncio
import threading

import numpy as np
import pytest
from relay import Relay

import r6


def test_values_have_ages_and_a_quality(virtual_robot: r6.Robot) -> None:
    with virtual_robot.subscribe("axis-0", "curMode", "curMold", every=0.02) as state:
        for snapshot in state:
            if all(value.quality != "not_read" for value in snapshot.values):
                break
        assert [value.quality for value in snapshot.values] == ["fresh", "fresh", "unsupported"]
        assert snapshot["curMode"].reading == 7 and snapshot.fresh("curMold") is None
        assert snapshot.array().shape == (3,) and np.isnan(snapshot.array()[2])
        ages = snapshot.ages()
        assert ages.dtype == np.float64 and (ages[:2] >= 0).all() and (ages[:2] < 2).all()
        assert snapshot.failure is None
        with pytest.raises(KeyError):
            snapshot["axis-5"]
        latest = state.latest()
        assert latest["axis-0"].address == "axis-0"


def test_a_wait_has_a_limit(virtual_robot: r6.Robot) -> None:
    with virtual_robot.subscribe("curMode", every=3600) as state:
        while state.latest()["curMode"].quality == "not_read":
            state.next(timeout=10)
        with pytest.raises(TimeoutError):
            while True:
                state.next(timeout=0.05)


def test_it_ends_with_the_robot(virtual_robot: r6.Robot) -> None:
    state = virtual_robot.subscribe("curMode", every=0.02)
    virtual_robot.close()
    assert [snapshot for snapshot in state][-1:] is not None
    assert state.next() is None
    state.close()
    with pytest.raises(RuntimeError, match="closed"):
        state.latest()


def test_it_goes_on_after_a_lost_connection(relay: Relay, virtual_controller: r6.Simulator) -> None:
    relay.target = virtual_controller.port
    with r6.Robot.connect(relay.address) as robot, robot.subscribe("curMode", every=0.02) as state:
        lost = robot.pushed()
        while state.latest().fresh("curMode") != 7:
            state.next(timeout=10)
        relay.cut()
        event = lost.next(timeout=10)
        assert isinstance(event, r6.ConnectionLost)
        while not isinstance(event, r6.Reconnected):
            event = lost.next(timeout=10)
        while state.latest().fresh("curMode") != 7:
            state.next(timeout=10)


def test_what_cannot_be_subscribed_to_is_told(virtual_robot: r6.Robot) -> None:
    with pytest.raises(r6.NotSubscribed, match="no address"):
        virtual_robot.subscribe(every=1)
    with pytest.raises(r6.NotSubscribed, match="period"):
        virtual_robot.subscribe("curMode", every=0.001)
    with pytest.raises(r6.UnknownAddress):
        virtual_robot.subscribe("nothing", every=1)


def read(state: r6.Subscription) -> None:
    """Waits until the first values are there, so that the next ones are an hour away."""
    while state.latest()["curMode"].quality == "not_read":
        state.next(timeout=10)


def test_closing_ends_the_waiting_of_another_thread(virtual_robot: r6.Robot) -> None:
    state = virtual_robot.subscribe("curMode", every=3600)
    read(state)
    came: list[object] = []
    waits = threading.Event()

    def wait() -> None:
        waits.set()
        while (snapshot := state.next(timeout=60)) is not None:
            pass
        came.append(snapshot)

    threads = [threading.Thread(target=wait) for _ in range(2)]
    for thread in threads:
        thread.start()
    waits.wait()
    for thread in threads:
        thread.join(0.2)
        assert thread.is_alive(), "the next values are an hour away"
    state.close()
    for thread in threads:
        thread.join(30)
    assert came == [None, None]
    assert state.next() is None and list(state) == []
    with pytest.raises(RuntimeError, match="closed"):
        state.latest()


def test_closing_ends_the_waiting_of_another_task(virtual_controller: r6.Simulator) -> None:
    async def main() -> None:
        async with r6.AsyncRobot.connect(virtual_controller.address) as robot:
            state = robot.subscribe("curMode", every=3600)
            while (await state.latest())["curMode"].quality == "not_read":
                await state.next(timeout=10)

            async def rest() -> list[r6.Snapshot]:
                return [snapshot async for snapshot in state]

            waiting = asyncio.ensure_future(rest())
            await asyncio.wait([waiting], timeout=0.2)
            assert not waiting.done(), "the next values are an hour away"
            state.close()
            assert await asyncio.wait_for(waiting, 30) is not None
            assert await state.next() is None

    asyncio.run(main())


def test_events_end_with_the_robot_whatever_else_lives(virtual_controller: r6.Simulator) -> None:
    robot = r6.Robot.connect(virtual_controller.address)
    with robot.subscribe("curMode", every=3600) as state:
        read(state)
        events, ended = robot.pushed(), threading.Event()

        def wait() -> None:
            list(events)
            ended.set()

        thread = threading.Thread(target=wait, daemon=True)
        thread.start()
        virtual_controller.request_photo(1)
        robot.close()
        assert ended.wait(30), "they go on"
        assert events.next(timeout=10) is None
        thread.join(30)


def test_events_end_with_the_robot_whatever_else_lives_in_asyncio(virtual_controller: r6.Simulator) -> None:
    async def main() -> None:
        robot = await r6.AsyncRobot.connect(virtual_controller.address)
        async with robot.subscribe("curMode", every=3600):
            events = robot.pushed()
            waiting = asyncio.ensure_future(events.next())
            await asyncio.sleep(0)
            await robot.close()
            assert await asyncio.wait_for(waiting, 30) is None

    asyncio.run(main())
