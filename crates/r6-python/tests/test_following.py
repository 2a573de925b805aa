"""Following a moving target."""

import asyncio
import time

import numpy as np
import pytest
from logged import commands, lists

import r6


def j1(degrees: float) -> r6.AxisPosition:
    return r6.AxisPosition.degrees([degrees])


def steps(controller: r6.Simulator) -> int:
    return len(lists(controller.log()))


def hold(
    following: r6.Following, target: float, controller: r6.Simulator, until: float | None = None
) -> None:
    """Sends the same target until the arm is there, or at ``until``."""
    end = target if until is None else until
    while abs(controller.snapshot().axes[0] - end) > 0.01:
        following.target(j1(target))
        time.sleep(0.02)


@pytest.mark.virtual_controller(clock=20)
def test_the_arm_goes_to_the_target_in_steps(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    with virtual_robot.follow() as following:
        hold(following, 35.0, virtual_controller)
        hold(following, -5.0, virtual_controller)
    followed = following.finished()
    assert followed.steps == steps(virtual_controller) == 8, "10 deg each"
    assert followed.axes[0] == pytest.approx(-5.0, abs=0.01)
    assert followed.behind is not None and followed.behind < 0.01
    with pytest.raises(RuntimeError, match="has ended"):
        following.target(j1(0.0))


@pytest.mark.virtual_controller(clock=20)
def test_options_are_taken(virtual_robot: r6.Robot, virtual_controller: r6.Simulator) -> None:
    options = r6.FollowOptions(
        interval=0.02, speed=r6.Percent(50), largest_step=r6.Degrees(5), smallest_step=r6.Degrees(2), fresh_within=1
    )
    assert "speed=50" in repr(options) and "largest_step=5" in repr(options) and "while_moving=False" in repr(options)
    with virtual_robot.follow(options) as following:
        hold(following, 21.5, virtual_controller, until=20.0)
    followed = following.finished()
    assert followed.steps == 4
    assert followed.behind == pytest.approx(1.5, abs=0.01), "nearer than the smallest step"
    with pytest.raises(TypeError):
        r6.FollowOptions(speed=50)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="interval"):
        r6.FollowOptions(interval=0)


def test_a_block_that_fails_stops_the_arm(virtual_robot: r6.Robot, virtual_controller: r6.Simulator) -> None:
    with pytest.raises(ZeroDivisionError):
        with virtual_robot.follow() as following:
            while not virtual_controller.snapshot().moving:
                following.target(j1(90.0))
                time.sleep(0.01)
            raise ZeroDivisionError
    state = virtual_controller.snapshot()
    assert not state.moving and state.list_length == 0
    assert "actionStop" in commands(virtual_controller.log())
    with pytest.raises(r6.MotionError) as failed:
        following.finished()
    assert failed.value.cause == "stopped_here"


@pytest.mark.virtual_controller(start="stopped")
def test_a_machine_that_is_not_ready_says_why(virtual_robot: r6.Robot, virtual_controller: r6.Simulator) -> None:
    with pytest.raises(r6.NotReady, match="Cycle on"):
        with virtual_robot.follow() as following:
            hold(following, 20.0, virtual_controller)


def test_an_alarm_is_told_to_who_tells_the_target(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    with pytest.raises(r6.MotionError) as failed:
        with virtual_robot.follow() as following:
            while not virtual_controller.snapshot().moving:
                following.target(j1(90.0))
                time.sleep(0.01)
            virtual_controller.raise_alarm(4999)
            hold(following, 90.0, virtual_controller)
    assert (failed.value.cause, failed.value.alarm) == ("alarm_raised", 4999)


def test_a_guard_holds_the_steps_and_a_motion_has_its_turn(virtual_robot: r6.Robot) -> None:
    narrow = r6.Envelope().axis_limits(0, r6.Degrees(-5), r6.Degrees(5))
    following = virtual_robot.with_guard(narrow).follow()
    with pytest.raises(r6.MotionError) as failed:
        while True:
            following.target(j1(30.0))
            time.sleep(0.01)
    assert failed.value.cause == "outside_envelope" and failed.value.nothing_left
    assert virtual_robot.run(r6.Motion().axis_move(j1(1.0), r6.Percent(50))).finished().moved


@pytest.mark.virtual_controller(clock=20)
def test_asyncio_follows_as_well(virtual_controller: r6.Simulator) -> None:
    async def main() -> None:
        async with r6.AsyncRobot.connect(virtual_controller.address) as robot:
            async with robot.follow() as following:
                while np.abs(virtual_controller.snapshot().axes[0] - 15.0) > 0.01:
                    following.target(j1(15.0))
                    await asyncio.sleep(0.02)
            followed = await following.finished()
            assert followed.steps == 2 and followed.behind is not None and followed.behind < 0.01
            with pytest.raises(ZeroDivisionError):
                async with robot.follow() as other:
                    other.release()
                    raise ZeroDivisionError
            with pytest.raises(r6.MotionError) as failed:
                await other.finished()
            assert failed.value.cause == "dropped"

    asyncio.run(main())
    assert "actionStop" in commands(virtual_controller.log())
