"""A client as a camera."""

import asyncio
import inspect
import itertools
import signal
import textwrap
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import pytest
from pick import PROGRAM as PICK
from relay import Relay

import r6


def test_a_photo_is_asked_for_answered_and_its_points_sent(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    events = virtual_robot.pushed()
    assert virtual_robot.status().is_ready, "the controller knows of the connection"
    virtual_controller.request_photo(2)
    photo = events.next(timeout=10)
    assert photo == r6.Photo(cam_id=2)
    virtual_robot.answer_photo(r6.Photo(2))
    points = [r6.Point(x=1.5, y=2.5, z=3, angle=90, u=180, v=0, model_id=1, similarity=0.9, color=2), r6.Point(1, 2)]
    assert virtual_robot.add_points(2, points).points == 2
    assert virtual_robot.link_quality().strays == 0


def test_a_point_has_to_be_one(virtual_robot: r6.Robot) -> None:
    with pytest.raises(TypeError, match="r6.Point"):
        virtual_robot.add_points(0, [(1, 2)])  # type: ignore[list-item]
    with pytest.raises(TypeError):
        virtual_robot.add_points(0, [r6.Point(x="far", y=0)])  # type: ignore[arg-type]


def test_events_end_with_the_robot(virtual_robot: r6.Robot) -> None:
    events = virtual_robot.pushed()
    virtual_robot.close()
    assert [type(event) for event in events] in ([], [r6.ConnectionLost])


PART = r6.Point(x=20.0, y=10.0, z=-30.0, relative=True)


@contextmanager
def asked_again_and_again(controller: r6.Simulator) -> Iterator[None]:
    """Asks for photos until this ends, because the client may not listen yet."""
    ended = threading.Event()

    def ask() -> None:
        while not ended.wait(0.05):
            controller.request_photo(2)

    thread = threading.Thread(target=ask)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@pytest.mark.virtual_controller(program=PICK, clock=10)
def test_photos_are_served_and_the_arm_goes_there(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    seen: list[int] = []

    def look(cam_id: int) -> r6.Shot:
        seen.append(cam_id)
        return "failed" if len(seen) == 1 else [PART]

    assert virtual_robot.status().alarm == 0, "the controller knows of the connection"
    with ThreadPoolExecutor() as pool:
        serving = pool.submit(virtual_robot.serve_photos, look)
        until = time.monotonic() + 60
        while not virtual_controller.is_on("Y010") and time.monotonic() < until:
            time.sleep(0.01)
        virtual_robot.close()
        ended = serving.result(60)
    assert (ended.reason, ended.error, ended.missed) == ("closed", None, None) and "closed" in str(ended)
    assert virtual_controller.is_on("Y010"), "the arm went to the part"
    assert seen == [1, 1], "what failed was asked for again"


def test_a_stop_does_not_wait_for_a_picture(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    """Nothing else is sent either; the points of that picture are not sent."""
    looking, taken = threading.Event(), threading.Event()

    def look(cam_id: int) -> r6.Shot:
        looking.set()
        assert taken.wait(60)
        return [r6.Point(x=1, y=2)]

    assert virtual_robot.status().is_ready
    with ThreadPoolExecutor() as pool, asked_again_and_again(virtual_controller):
        serving: Future[r6.PhotosEnded] = pool.submit(virtual_robot.serve_photos, look)
        assert looking.wait(60)
        sent = virtual_robot.link_quality().requests
        assert virtual_robot.stop().confirmed
        assert virtual_robot.query("curMode") and not serving.done()
        before = virtual_robot.link_quality().requests
        taken.set()
        assert serving.result(60).reason == "stopped"
    assert virtual_robot.link_quality().requests == before > sent, "no points were sent"


GO_THERE = """
[[step]]
do = "axis-move"
to = [0, 10, -20, 0, -80, 40]
speed = 100
[[step]]
do = "take-point"
[[step]]
do = "move-to-point"
speed = 50
[[step]]
do = "remote"
"""


@pytest.mark.virtual_controller(program=GO_THERE, clock=10)
def test_angles_that_are_left_out_stay_as_they_are(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    def standing() -> list[float]:
        until = time.monotonic() + 60
        before = None
        while time.monotonic() < until:
            # The program moves on only after a point. An unchanged pose away from home 0.2 s later is the end.
            pose = [float(value) for value in virtual_robot.status().pose.round(3)]
            if pose == before and abs(pose[5]) > 1:
                return pose
            before = pose
            # The controller's clock runs ten times as fast.
            time.sleep(0.02)
        raise AssertionError("it does not stand")

    begin = standing()
    assert max(abs(angle) for angle in begin[3:6]) > 90, begin
    goal = [begin[0] + 15, begin[1] - 10, begin[2] - 5]
    assert virtual_robot.add_points(0, [r6.Point(x=goal[0], y=goal[1], z=goal[2])]).points == 1
    until = time.monotonic() + 60
    while (end := standing())[:3] != pytest.approx(goal, abs=0.01):
        assert time.monotonic() < until, end
    assert [(e - b + 540) % 360 - 180 for e, b in zip(end[3:6], begin[3:6])] == pytest.approx([0, 0, 0], abs=0.01)


NOWHERE = r6.Point(x=float("nan"), y=2)


@pytest.mark.parametrize("points", [[PART, NOWHERE], [PART] * 100], ids=["no number", "too many"])
def test_points_that_cannot_be_sent_are_not_promised(
    points: list[r6.Point], virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    assert virtual_robot.status().is_ready
    with asked_again_and_again(virtual_controller):
        ended = virtual_robot.serve_photos(lambda _: points)
    assert (ended.reason, ended.cam_id) == ("request", 2)
    assert isinstance(ended.error, r6.InvalidRequest) and not ended.error.may_send_again
    said = [line.event["event"] for line in virtual_controller.log()]
    assert "photo_answered" not in said, said


def test_photos_are_served_by_one_at_a_time(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    looking, taken = threading.Event(), threading.Event()

    def look(cam_id: int) -> r6.Shot:
        looking.set()
        assert taken.wait(60)
        return "failed"

    assert virtual_robot.status().is_ready
    with ThreadPoolExecutor() as pool, asked_again_and_again(virtual_controller):
        serving: Future[r6.PhotosEnded] = pool.submit(virtual_robot.serve_photos, look)
        assert looking.wait(60)
        again = virtual_robot.serve_photos(lambda _: [PART])
        assert again.reason == "served_already" and "served already" in str(again)
        taken.set()
        virtual_robot.close()
        assert serving.result(60).reason in ("closed", "request")


class Blurred(Exception):
    """An error of a user's camera."""


def test_what_look_raises_comes_out_and_the_robot_goes_on(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    def look(cam_id: int) -> r6.Shot:
        raise Blurred(cam_id)

    assert virtual_robot.status().is_ready
    with asked_again_and_again(virtual_controller):
        with pytest.raises(Blurred, match="2"):
            virtual_robot.serve_photos(look)
        with pytest.raises(TypeError, match="NoneType"):
            virtual_robot.serve_photos(lambda _: None)  # type: ignore[arg-type, return-value]
        with pytest.raises(TypeError, match="r6.Point"):
            virtual_robot.serve_photos(lambda _: [1])  # type: ignore[list-item]
        with pytest.raises(ValueError, match="not_mine"):
            virtual_robot.serve_photos(lambda _: "none")  # type: ignore[arg-type, return-value]
    assert virtual_robot.status().is_ready
    assert virtual_robot.add_points(2, [r6.Point(1, 2)]).points == 1


@pytest.mark.parametrize("at", ["waiting", "looking"])
def test_ctrl_c_ends_the_serving(
    at: str, virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    looked: list[int] = []

    def look(cam_id: int) -> r6.Shot:
        looked.append(cam_id)
        if at == "looking":
            signal.raise_signal(signal.SIGINT)
            time.sleep(60)
        return "not_mine"

    assert virtual_robot.status().is_ready
    if at == "waiting":
        threading.Timer(0.3, signal.raise_signal, [signal.SIGINT]).start()
        with pytest.raises(KeyboardInterrupt):
            virtual_robot.serve_photos(look)
    else:
        with asked_again_and_again(virtual_controller), pytest.raises(KeyboardInterrupt):
            virtual_robot.serve_photos(look)
    assert len(looked) == (at == "looking")
    assert virtual_robot.status().is_ready


def test_a_lost_connection_ends_the_serving(virtual_controller: r6.Simulator, relay: Relay) -> None:
    relay.target = virtual_controller.port
    with r6.Robot.connect(relay.address) as robot, ThreadPoolExecutor() as pool:
        assert robot.status().is_ready
        looking = threading.Event()

        def look(cam_id: int) -> r6.Shot:
            looking.set()
            return []

        with asked_again_and_again(virtual_controller):
            serving = pool.submit(robot.serve_photos, look)
            assert looking.wait(60)
            relay.cut()
            ended = serving.result(60)
    assert ended.reason in ("connection_lost", "request") and ended.text


def test_photos_are_served_through_asyncio(virtual_controller: r6.Simulator) -> None:
    """A picture that is under way during a stop is cancelled."""
    cancelled: list[int] = []
    looking = asyncio.Event()

    async def look(cam_id: int) -> r6.Shot:
        looking.set()
        try:
            await asyncio.sleep(60)
        except asyncio.CancelledError:
            cancelled.append(cam_id)
            raise
        return []

    async def at_once(cam_id: int) -> r6.Shot:
        raise Blurred(cam_id)

    async def main() -> None:
        async with r6.AsyncRobot.connect(virtual_controller.address) as robot:
            assert (await robot.status()).is_ready
            serving = asyncio.create_task(robot.serve_photos(look))
            # A request before the serving has begun is not seen.
            await asyncio.sleep(0.05)
            while not looking.is_set():
                virtual_controller.request_photo(2)
                await asyncio.sleep(0.05)
            await robot.stop()
            assert (await serving).reason == "stopped"
            await asyncio.sleep(0)
            assert cancelled == [2]
            with asked_again_and_again(virtual_controller), pytest.raises(Blurred):
                await robot.serve_photos(at_once)
            serving = asyncio.create_task(robot.serve_photos(look))
            await asyncio.sleep(0.05)
            serving.cancel()
            with pytest.raises(asyncio.CancelledError):
                await serving
            assert (await robot.query("curMode")).integer("curMode")

    asyncio.run(asyncio.wait_for(main(), 60))


def example_of(function: object) -> str:
    """The code block in the docstring."""
    text = inspect.getdoc(function) or ""
    _, _, rest = text.partition("::\n\n")
    lines = itertools.takewhile(lambda line: not line or line.startswith("    "), rest.splitlines())
    return textwrap.dedent("\n".join(lines))


def test_the_example_of_serve_photos_picks_on_the_shipped_program() -> None:
    with r6.Simulator(program="pick-and-place", clock=20) as controller:
        controller.set_input("X010", True)
        with r6.Robot.connect(controller.address) as robot, ThreadPoolExecutor() as pool:
            serving = pool.submit(exec, example_of(r6.Robot.serve_photos), {"r6": r6, "robot": robot})
            while robot.counter(0).current < 2:
                assert controller.snapshot().alarm == 0
                assert not serving.done(), serving.exception()
            robot.close()
            serving.result(timeout=60)


def test_a_program_may_be_named() -> None:
    with r6.Simulator(program="palletise") as controller:
        assert controller.snapshot().program == "palletise"
    with pytest.raises(r6.SimulatorError):
        r6.Simulator(program="paletise")
