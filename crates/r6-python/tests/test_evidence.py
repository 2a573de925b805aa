"""Statements about an arm are proved or not made (docs/EVIDENCE.md), also if the controller misbehaves."""

import asyncio
import gc
import warnings
from collections.abc import Callable
from typing import Any

import pytest
from hostile import Hostile
from interrupts import endless, until

import r6

Start = Callable[[dict[str, Any]], Hostile]
MEANS = ("action_stop", "stop_button", "action_pause", "clear")


def to(*angles: float) -> r6.Motion:
    """Moves of J1."""
    return r6.Motion().axis_path([[angle] for angle in angles], r6.Percent(50))


def test_done_names_its_motion(virtual_robot: r6.Robot) -> None:
    first = virtual_robot.run(to(5))
    done = first.finished()
    assert (first.number, done.motion, done.proof, done.cut_short) == (1, 1, "reached", None)
    second = virtual_robot.run(to(8))
    assert (second.number, second.finished().motion) == (2, 2)
    virtual_robot.add_rcc(to(5), replace=True)
    done = virtual_robot.wait_until_done()
    assert (done.motion, done.proof) == (None, "at_rest")


@pytest.mark.virtual_controller(profile="hc1", clock=20)
@pytest.mark.parametrize("how", ["dropped", "released", "held"])
def test_a_motion_without_a_handle_goes_on_and_its_end_is_waited_for(
    how: str, virtual_robot: r6.Robot
) -> None:
    handle = virtual_robot.run(to(*[30.0, -30.0] * 30, 12.0))
    assert handle.step(1).started()
    number = handle.number
    if how == "released":
        handle.release()
    if how == "dropped":
        del handle
        gc.collect()
    done = virtual_robot.wait_until_done()
    assert (done.motion, done.proof) == (number, "reached")
    assert done.axes[0] == pytest.approx(12, abs=0.01)
    if how != "dropped":
        assert handle.finished().motion == number, "the handle tells it, too"


@pytest.mark.parametrize("held", [True, False])
def test_a_motion_that_fails_is_told_to_who_waits_next(held: bool, virtual_robot: r6.Robot) -> None:
    motion = to(5).axis_move(r6.AxisPosition.degrees([0] * 5 + [4000]), r6.Percent(50))
    handle = virtual_robot.run(motion)
    assert handle.ended_within(60), "nobody was told how"
    if not held:
        del handle
    with pytest.raises(r6.WaitError) as failed:
        virtual_robot.wait_until_done()
    assert failed.value.cause == "motion"
    assert isinstance(failed.value.__cause__, r6.MotionError)
    assert failed.value.__cause__.cause == "alarm_raised"


def test_a_dropped_motion_that_failed_is_told_by_the_next_one(virtual_robot: r6.Robot) -> None:
    handle = virtual_robot.run(to(5).axis_move(r6.AxisPosition.degrees([0] * 5 + [4000]), r6.Percent(50)))
    assert handle.ended_within(60)
    del handle
    for cause in ("earlier_failed", "not_ready"):
        with pytest.raises(r6.MotionError) as failed:
            virtual_robot.run(to(0))
        assert failed.value.cause == cause and failed.value.nothing_left
        if cause == "earlier_failed":
            assert isinstance(failed.value.__cause__, r6.MotionError)
            assert failed.value.__cause__.cause == "alarm_raised"


def test_a_dropped_motion_that_is_to_be_stopped_is_stopped(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    handle = virtual_robot.run(endless(), r6.RunOptions(stop_on_drop=True))
    assert handle.step(1).started()
    handle.release()
    with pytest.raises(r6.MotionError) as failed:
        handle.finished()
    assert failed.value.cause == "dropped"
    state = virtual_controller.snapshot()
    assert not state.moving and state.list_length == 0
    with pytest.raises(r6.WaitError) as told:
        virtual_robot.wait_until_done()
    assert told.value.cause == "motion"


def test_closing_warns_of_a_motion_that_it_cuts_short(virtual_controller: r6.Simulator) -> None:
    robot = r6.Robot.connect(virtual_controller.address)
    handle = robot.run(endless())
    assert handle.step(1).started()
    with pytest.warns(r6.MotionCutShort, match="closed before the motion was at its end.*never sent") as said:
        robot.close()
    assert [warning.filename for warning in said] == [__file__]
    with warnings.catch_warnings(record=True) as again:
        robot.close()
    assert again == []


def test_the_end_of_a_block_warns_of_a_motion_that_it_cuts_short(virtual_controller: r6.Simulator) -> None:
    with pytest.warns(r6.MotionCutShort) as said:
        with r6.Robot.connect(virtual_controller.address) as robot:
            assert robot.run(endless()).step(1).started()
    assert [warning.filename for warning in said] == [__file__]


def test_closing_through_asyncio_warns_of_a_motion_that_it_cuts_short(virtual_controller: r6.Simulator) -> None:
    async def close() -> None:
        robot = await r6.AsyncRobot.connect(virtual_controller.address)
        handle = await robot.run(endless())
        assert handle.number == 1 and await handle.step(1).started()
        await robot.close()

    async def block() -> None:
        async with r6.AsyncRobot.connect(virtual_controller.address) as robot:
            await robot.stop()
            virtual_controller.press("start")
            await (await robot.run(endless())).step(1).started()

    for main in (close, block):
        with pytest.warns(r6.MotionCutShort, match="never sent") as said:
            asyncio.run(main())
        assert [warning.filename for warning in said] == [__file__]


@pytest.mark.parametrize("effect", ["no-effect", "refused"])
def test_a_dwell_is_no_standstill(effect: str, hostile: Start) -> None:
    """The arm stands between two moves, and nothing that a stop sends has an effect."""
    stops = {means: {"effect": effect} for means in MEANS}
    controller = hostile({"dwell": 0.33, "stops": stops})
    with r6.Robot.connect(controller.address) as robot:
        handle = robot.run(to(*[30.0, -30.0] * 6))
        assert handle.step(1).started()
        report = robot.stop()
        assert not report.confirmed and report.proof is None
        assert report.text.startswith("NOT CONFIRMED") and "use the emergency stop" in report.text
        told = controller.ask("now")["now"]
        until("it moves on", lambda: controller.ask(f"path {told}")[0] > 1)


def test_values_of_another_robot_are_not_handed_out(hostile: Start) -> None:
    swap = {"when": "told", "links": "end", "to": {"name": "cell 5", "axes": [77.0] * 8}}
    controller = hostile({"swap": swap})
    with r6.Robot.connect(controller.address) as robot:
        assert robot.status().machine_name == "cell 4"
        controller.ask("swap")
        found: list[r6.Identity] = []

        def refused() -> bool:
            try:
                assert robot.query("axis-0").number("axis-0") == 0, "cell 5 stands at 77"
            except r6.OutcomeUnknown as error:
                if error.reason == "another_robot":
                    assert error.expected is not None and error.expected.machine_name == "cell 4"
                    assert error.found is not None
                    found.append(error.found)
            except r6.NotSent:
                pass
            return bool(found)

        until("it is told who answers", refused)
        assert found[0].machine_name == "cell 5"
        robot.accept_identity(found[0])
        assert robot.query("axis-0").number("axis-0") == 77


def test_a_stop_names_the_robot_that_it_is_about(hostile: Start) -> None:
    controller = hostile({})
    with r6.Robot.connect(controller.address) as robot:
        robot.status()
        report = robot.stop()
        assert report.confirmed and report.robot is not None
        assert (report.robot.machine_name, report.connection) == ("cell 4", robot.stop().connection)


def test_a_program_that_waits_for_an_input_is_no_standstill(hostile: Start) -> None:
    steps = [
        {"action": "100", "type": "100", "limit": "8"},
        {"action": "4", "m0": "40", "ckStatus": "0x3F", "speed": "10"},
    ]
    stops = {means: {"effect": "no-effect"} for means in MEANS}
    controller = hostile({"program": {"steps": steps}, "stops": stops, "cabinet": {"mode": 7}})
    with r6.Robot.connect(controller.address) as robot:
        assert not robot.stop().confirmed


def test_a_power_cut_in_the_middle_of_a_motion_is_told_as_such(hostile: Start) -> None:
    controller = hostile({"reboot": {"at": 1000}})
    with r6.Robot.connect(controller.address) as robot:
        handle = robot.run(to(*[5.0 * n for n in range(1, 30)]))
        assert handle.step(2).started()
        controller.ask("reboot")
        with pytest.raises(r6.MotionError) as failed:
            handle.finished()
        assert (failed.value.cause, failed.value.mode) == ("restarted", 3)
        assert "switched off and on" in str(failed.value)


def test_a_list_that_another_client_cleared_is_not_done(hostile: Start) -> None:
    controller = hostile({})
    with r6.Robot.connect(controller.address) as robot:
        handle = robot.run(to(*[5.0 if n % 2 else 0.0 for n in range(1, 16)]))
        assert handle.step(5).started()
        controller.ask("foreign-clear")
        with pytest.raises(r6.MotionError) as failed:
            handle.finished()
        assert failed.value.cause == "not_seen"


def test_a_value_of_another_robot_is_never_fresh(hostile: Start) -> None:
    swap = {"when": "told", "links": "end", "to": {"name": "cell 5", "axes": [77.0] * 8}}
    controller = hostile({"swap": swap})
    with r6.Robot.connect(controller.address) as robot:
        # The caller did not ask for the identity: the client reads it on the first connection.
        with robot.subscribe("axis-0", every=0.05) as subscription:
            until("there is a value", lambda: subscription.latest()["axis-0"].quality == "fresh")
            controller.ask("swap")
            told = controller.ask("now")["now"]
            while controller.ask("now")["now"] < told + 3:
                value = subscription.latest()["axis-0"]
                assert value.quality != "fresh" or value.reading == 0, value


def test_a_target_that_was_told_once_is_followed_for_half_a_second_and_no_further(hostile: Start) -> None:
    controller = hostile({})
    with r6.Robot.connect(controller.address) as robot:
        with robot.follow() as following:
            following.target(r6.AxisPosition.degrees([75]))
            told = controller.ask("now")["now"]
            until("it is too old", lambda: controller.ask("now")["now"] > told + 2)
            behind = controller.ask("position")
        followed = following.finished()
        assert followed.axes[0] is not None and followed.axes[0] < 75, "it was too old for the rest of the way"
        assert behind[0] == pytest.approx(followed.axes[0], abs=0.01), "it stood by then"
        assert followed.behind == pytest.approx(75 - followed.axes[0], abs=0.01)
