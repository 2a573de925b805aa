"""Motions: built, run, followed, stopped."""

import json
import math
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from logged import commands

import r6

FAST = r6.Percent(50)
HOME = r6.AxisPosition.degrees([0, 0, 0, 0, 30, 0])


def circle(points: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    turn = np.linspace(0, 2 * math.pi, points)
    path = np.zeros((points, 6))
    path[:, 0], path[:, 1], path[:, 4] = 20 * np.sin(turn), 10 * (1 - np.cos(turn)), 30
    return path


def endless() -> r6.Motion:
    """Hours of moves."""
    return r6.Motion().axis_path(np.tile([[40.0], [-40.0]], (1000, 1)), r6.Percent(5))


def test_a_wrong_step_is_told_at_once_and_spoils_the_motion(virtual_robot: r6.Robot) -> None:
    motion = r6.Motion().axis_move(HOME, FAST)
    with pytest.raises(r6.StepError, match="blend level") as error:
        motion.blend(10)
    assert (error.value.step, error.value.field) == (1, "smooth") and isinstance(error.value, ValueError)
    with pytest.raises(r6.MotionError) as failed:
        virtual_robot.run(motion)
    assert failed.value.cause == "step" and failed.value.nothing_left
    assert isinstance(failed.value.__cause__, r6.StepError)
    with pytest.raises(r6.StepError):
        virtual_robot.dry_run(motion)


def test_names_of_points_are_checked() -> None:
    motion = r6.Motion()
    with pytest.raises(ValueError, match="is an input"):
        motion.set_output("X010", True)
    with pytest.raises(ValueError, match="first board"):
        motion.set_output("Y1.010", True)
    with pytest.raises(ValueError, match="is an output"):
        motion.wait_for("Y010")
    with pytest.raises(ValueError, match="falling"):
        motion.wait_for("X010", "never")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="only outputs Y"):
        motion.pulse_output("M010", True, 1)
    with pytest.raises(ValueError, match="seconds"):
        motion.wait(-1)
    assert len(motion) == 0


def test_the_end_is_waited_for_so_long(virtual_robot: r6.Robot) -> None:
    handle = virtual_robot.run(endless())
    assert not handle.ended_within(0.05) and not handle.progress.ended
    handle.stop()
    assert handle.ended_within(60)
    with pytest.raises(r6.MotionError):
        handle.finished()


def test_outputs_of_a_board_are_set_at_once(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    virtual_robot.set_output("Y012", True)
    virtual_robot.set_output("Y013", True)
    motion = r6.Motion().set_board({"Y010": True, "Y012": False, "Y047": True}).set_board({"M1.011": True})
    frames = [json.loads(frame) for frame in virtual_robot.dry_run(motion)]
    steps = [step for frame in frames for step in frame["instructions"]]
    assert [(step["action"], step["type"]) for step in steps] == [("204", "0"), ("204", "6")]
    assert (int(steps[0]["point"]), int(steps[0]["point2"])) == (0b01_00_10, 0b10 << 30)
    virtual_robot.run(motion).finished()
    assert np.flatnonzero(virtual_robot.outputs()).tolist() == [0, 3, 31]
    assert virtual_controller.is_on("M1.011")


def test_a_board_is_one_board() -> None:
    motion = r6.Motion()
    with pytest.raises(ValueError, match="of one board"):
        motion.set_board({"Y010": True, "Y1.010": True})
    with pytest.raises(ValueError, match="first two"):
        motion.set_board({"Y2.010": True})
    with pytest.raises(ValueError, match="X010"):
        motion.set_board({"X010": True})
    with pytest.raises(ValueError, match="no point"):
        motion.set_board({})
    assert len(motion) == 0


def test_a_dry_run_shows_the_frames(virtual_robot: r6.Robot) -> None:
    motion = (
        r6.Motion()
        .axis_move(HOME, FAST)
        .blend(3)
        .set_output("Y012", True)
        .wait_for("X011", "rising", limit=2)
        .wait(0.5)
        .path_speed(r6.MillimetresPerSecond(200))
        .linear_move_at_path_speed(r6.Pose.mm_deg([500, 0, 400]))
        .pulse_output("Y010", True, 0.2)
        .workbench(1)
        .stop_on_input("X013", True)
    )
    motion.extend(motion)
    assert len(motion) == 18
    steps = []
    for number, frame in enumerate(virtual_robot.dry_run(motion)):
        request = json.loads(frame)
        assert request["emptyList"] == ("1" if number == 0 else "0") and len(frame) <= 2048
        steps += request["instructions"]
    assert [int(step["action"]) for step in steps[:9]] == [4, 200, 100, 100, 51, 10, 200, 800, 52]
    assert steps[0]["m4"] == "30.000" and steps[0]["smooth"] == "3"
    assert virtual_robot.query("RemoteCmdLen").integer("RemoteCmdLen") == 0


@pytest.mark.virtual_controller(profile="hc1", clock=20)
def test_a_path_of_500_points_ends_where_it_should(virtual_robot: r6.Robot) -> None:
    path = circle(500)
    path[-1, :2] = [5.0, 5.0]
    motion = r6.Motion().axis_path(path, FAST, blend=5)
    handle = virtual_robot.run(motion, r6.RunOptions(interval=0.02))
    seen = [progress.done for progress in handle]
    assert seen == sorted(seen) and seen[-1] == 500
    done = handle.finished()
    assert done.moved and done.axes.shape == (6,) and done.axes.dtype == np.float64
    assert np.abs(done.axes - path[-1]).max() < 0.01
    assert handle.finished().axes is not done.axes, "the end can be asked for again"


@pytest.mark.virtual_controller(profile="legacy", clock=20)
def test_a_firmware_without_a_list_length_is_followed_by_position(virtual_robot: r6.Robot) -> None:
    path = circle(40)
    done = virtual_robot.run(r6.Motion().axis_path(path, FAST)).finished()
    assert np.abs(done.axes - path[-1]).max() < 0.01


@pytest.mark.virtual_controller(clock=20)
def test_steps_are_followed_one_by_one(virtual_robot: r6.Robot) -> None:
    handle = virtual_robot.run(r6.Motion().axis_path(circle(60), r6.Percent(5)))
    first, last = handle.step(1), handle.step(60)
    assert last.state == "queued"
    assert first.started() and first.done() and first.state == "done"
    assert last.done() and handle.progress.step(60) == "done"
    with pytest.raises(IndexError, match="1 to 60"):
        handle.step(61)
    handle.finished()


def test_linear_moves_end_at_their_pose(virtual_robot: r6.Robot) -> None:
    pose = virtual_robot.run(r6.Motion().axis_move(HOME, FAST)).finished().pose
    targets = pose + np.array([[0, 0, -30, 0, 0, 0], [0, 20, -30, 0, 0, 0]])
    done = virtual_robot.run(r6.Motion().linear_path(targets, FAST, blend=2)).finished()
    assert np.allclose(done.pose[:3], targets[-1, :3], atol=0.01)
    back = r6.Pose.mm_deg(pose[:3])
    through = r6.Pose.mm_deg(pose[:3] + [0, 10, 0])
    # The controller accepts a curve without a line before it and does not execute it, as real ones do.
    with pytest.raises(r6.MotionError, match="Y is at"):
        virtual_robot.run(r6.Motion().curve_move(through, back, FAST)).finished()
    virtual_robot.command(r6.Command.start_button())
    line = r6.Motion().linear_path(targets[-1:], FAST)
    done = virtual_robot.run(line.curve_move(through, back, FAST)).finished()
    assert np.allclose(done.pose[:3], pose[:3], atol=0.01)


def test_a_stop_ends_the_motion_and_clears_its_list(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    handle = virtual_robot.run(endless())
    assert handle.step(1).started()
    report = handle.stop()
    assert report.confirmed and report.moving is False and report.list in ("cleared", "was_empty")
    assert not virtual_controller.snapshot().moving and virtual_controller.snapshot().list_length == 0
    with pytest.raises(r6.MotionError) as failed:
        handle.finished()
    assert failed.value.cause == "stopped_here" and failed.value.progress.step(2000) == "queued"
    assert handle.progress.ended


def test_a_stop_within_a_block_ends_it_without_an_error(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    with virtual_robot.run(endless()) as handle:
        assert handle.step(1).started()
        assert handle.stop().confirmed
    assert handle.progress.ended and not virtual_controller.snapshot().moving
    virtual_robot.command(r6.Command.start_button())
    # A stop that this handle did not ask for raises an error.
    with pytest.raises(r6.MotionError) as failed:
        with virtual_robot.run(endless()) as handle:
            assert handle.step(1).started()
            assert virtual_robot.stop().confirmed
    assert failed.value.cause == "stopped_here"


def test_a_motion_goes_behind_another_and_repeats_until_it_is_stopped(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    def to(*degrees: float) -> r6.Motion:
        return r6.Motion().axis_path([[angle] for angle in degrees], FAST)

    behind = r6.RunOptions(append=True)
    done = virtual_robot.run(to(20), behind).finished()
    assert (done.proof, done.axes[0]) == ("reached", pytest.approx(20, abs=0.01))
    frame = virtual_robot.dry_run(to(20), behind)[0]
    assert b'"emptyList":"0"' in frame and "append=True" in repr(behind)
    with pytest.raises(r6.MotionError, match="`room`"):
        virtual_robot.run(to(*range(30)), behind)
    round_trip = to(5, 0).repeat()
    assert round_trip.repeats and not to(5, 0).repeats
    with virtual_robot.run(round_trip) as handle:
        for progress in handle:
            if progress.accepted == 2:
                break
        assert not handle.ended_within(0.2), "it has no end of its own"
        assert virtual_controller.snapshot().list_length == 2
        handle.stop()
    assert virtual_controller.snapshot().list_length == 0


def test_a_block_that_fails_stops_the_arm(virtual_robot: r6.Robot, virtual_controller: r6.Simulator) -> None:
    with pytest.raises(ZeroDivisionError):
        with virtual_robot.run(endless()) as handle:
            assert handle.step(1).started()
            raise ZeroDivisionError
    state = virtual_controller.snapshot()
    assert not state.moving and state.list_length == 0


def test_a_block_that_fails_after_the_motion_was_released_stops_the_arm(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    with pytest.raises(ZeroDivisionError):
        with virtual_robot.run(endless()) as handle:
            assert handle.step(1).started()
            handle.release()
            assert virtual_controller.snapshot().moving, "the motion goes on"
            raise ZeroDivisionError
    state = virtual_controller.snapshot()
    assert not state.moving and state.list_length == 0


def test_a_motion_that_fails_in_a_block_tells_what_became_of_the_arm(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    with pytest.raises(r6.MotionError) as failed:
        with virtual_robot.run(endless(), r6.RunOptions(stop_on_drop=True)) as handle:
            assert handle.step(1).started()
            handle.release()
            handle.finished()
    assert failed.value.cause == "dropped"
    assert isinstance(failed.value.stop, r6.StopReport) and failed.value.stop.confirmed
    assert not virtual_controller.snapshot().moving


def test_a_stop_that_fails_does_not_hide_why_the_motion_failed() -> None:
    with r6.Simulator() as controller, r6.Robot.connect(controller.address) as robot:
        with pytest.raises(r6.MotionError) as failed:
            with robot.run(endless()) as handle:
                assert handle.step(1).started()
                with pytest.warns(r6.MotionCutShort):
                    robot.close()
                handle.finished()
    assert isinstance(failed.value.stop, r6.NotSent) and failed.value.stop.reason == "closed"


def test_no_motion_begins_while_one_without_a_handle_is_streamed(virtual_robot: r6.Robot) -> None:
    handle = virtual_robot.run(endless())
    assert handle.step(1).started()
    del handle
    with pytest.raises(r6.MotionError) as failed:
        virtual_robot.run(endless())
    assert failed.value.cause == "another_runs"
    assert virtual_robot.stop().confirmed


@pytest.mark.parametrize("held", [True, False])
def test_closing_stops_a_motion_that_is_to_be_stopped_when_dropped(
    held: bool, virtual_controller: r6.Simulator
) -> None:
    """Also through another handle of the connection, and if the handle was dropped just before."""
    robot = r6.Robot.connect(virtual_controller.address)
    guarded = robot.with_guard(r6.Envelope())
    handle = guarded.run(endless(), r6.RunOptions(stop_on_drop=True))
    assert handle.step(1).started()
    if held:
        with pytest.warns(r6.MotionCutShort):
            robot.close()
    else:
        del handle
        # Closing or the drop ends the motion, whichever comes first.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", r6.MotionCutShort)
            robot.close()
    state = virtual_controller.snapshot()
    assert not state.moving and state.list_length == 0
    assert "actionStop" in commands(virtual_controller.log())


def test_closing_stops_no_other_motion(virtual_controller: r6.Simulator) -> None:
    with pytest.warns(r6.MotionCutShort), r6.Robot.connect(virtual_controller.address) as robot:
        quick = robot.run(r6.Motion().axis_move(HOME, FAST), r6.RunOptions(stop_on_drop=True))
        quick.finished()
        handle = robot.run(endless())
        assert handle.step(1).started()
    assert virtual_controller.snapshot().moving
    assert "actionStop" not in commands(virtual_controller.log())


def test_only_one_motion_runs_at_a_time(virtual_robot: r6.Robot) -> None:
    with pytest.raises(r6.MotionError) as failed:
        with virtual_robot.run(endless()):
            virtual_robot.run(endless())
    assert failed.value.cause == "another_runs"


@pytest.mark.virtual_controller(start="stopped")
def test_a_machine_that_is_not_ready_says_why(virtual_robot: r6.Robot) -> None:
    with pytest.raises(r6.NotReady, match="Cycle on") as error:
        virtual_robot.run(r6.Motion().axis_move(HOME, FAST))
    assert [unmet.kind for unmet in error.value.unmet] == ["mode"]
    assert error.value.unmet[0].value == r6.OperationMode.STOP
    assert not virtual_robot.status().is_ready


def test_an_alarm_ends_the_motion(virtual_robot: r6.Robot) -> None:
    motion = r6.Motion().axis_move(HOME, FAST).axis_move(r6.AxisPosition.degrees([0] * 5 + [4000]), FAST)
    with pytest.raises(r6.MotionError, match="J6") as failed:
        virtual_robot.run(motion).finished()
    assert failed.value.cause == "alarm_raised" and failed.value.alarm == 135
    assert isinstance(failed.value.stop, r6.StopReport) and failed.value.stop.confirmed


def test_a_guard_reckons_with_frames_inputs_and_units(virtual_robot: r6.Robot) -> None:
    far = r6.Millimetres(2000)
    box = r6.Envelope().workspace((-far, -far, -far), (far, far, far))
    guarded = virtual_robot.with_guard(box)
    line = r6.Motion().linear_move(r6.Pose.mm_deg([400, 0, 500]), r6.Percent(1))
    virtual_robot.command(r6.Command.switch_tool(1))
    with pytest.raises(r6.OutsideEnvelope, match="make a guard") as frame:
        guarded.add_rcc(line, replace=True)
    assert frame.value.what == "frame"
    small = r6.Envelope().largest_axis_step(r6.Degrees(30))

    def to(motion: r6.Motion, angle: float) -> r6.Motion:
        return motion.axis_move(r6.AxisPosition.degrees([angle]), r6.Percent(1))

    watched = to(to(r6.Motion(), 0).stop_on_input("X013", True), 25)
    small.check_motion(watched)
    with pytest.raises(r6.OutsideEnvelope, match="cannot be told") as cut:
        small.check_motion(to(watched, 50))
    assert cut.value.step == 4
    slides = r6.Motion().axis_move(r6.AxisPosition().with_axis(0, r6.Millimetres(5)), r6.Percent(1))
    with pytest.raises(r6.OutsideEnvelope, match="turns") as unit:
        small.check_motion(slides)
    assert unit.value.what == "J1 unit"
    for motion in (slides, r6.Motion().extend(slides)):
        with pytest.raises(r6.OutsideEnvelope, match="turns"):
            virtual_robot.with_guard(small).add_rcc(motion, replace=True)


def test_two_threads_do_not_both_begin_where_the_arm_stands(virtual_robot: r6.Robot) -> None:
    guarded = virtual_robot.with_guard(r6.Envelope().largest_axis_step(r6.Degrees(30)))
    assert virtual_robot.status().is_ready
    together = threading.Barrier(2)

    def send(angle: float) -> bool:
        motion = r6.Motion().axis_move(r6.AxisPosition.degrees([angle]), r6.Percent(20))
        together.wait(60)
        try:
            guarded.add_rcc(motion, replace=True)
        except r6.OutsideEnvelope:
            return False
        return True

    with ThreadPoolExecutor() as pool:
        assert sorted(pool.map(send, [25, -25])) == [False, True]


def test_a_guard_refuses_what_goes_beyond(virtual_robot: r6.Robot) -> None:
    envelope = r6.Envelope().speed_cap(r6.Percent(20)).axis_limits(0, r6.Degrees(-90), r6.Degrees(90))
    guarded = virtual_robot.with_guard(envelope)
    too_far = r6.Motion().axis_move(r6.AxisPosition.degrees([95]), r6.Percent(10))
    with pytest.raises(r6.OutsideEnvelope, match="J1 goes to 95 deg") as beyond:
        envelope.check_motion(too_far)
    assert (beyond.value.step, beyond.value.what, beyond.value.value) == (1, "J1", 95)
    assert beyond.value.limit == (-90, 90) and not beyond.value.may_send_again
    with pytest.raises(r6.MotionError) as failed:
        guarded.run(too_far)
    assert failed.value.cause == "outside_envelope" and failed.value.nothing_left
    with pytest.raises(r6.OutsideEnvelope):
        guarded.add_rcc(too_far, replace=True)
    with pytest.raises(r6.OutsideEnvelope, match="speed"):
        guarded.dry_run(r6.Motion().axis_move(HOME, FAST))
    corner = (r6.Millimetres(0),) * 3
    box = r6.Envelope().workspace(corner, corner).largest_distance(r6.Millimetres(5)).only(4, 10)
    with pytest.raises(r6.OutsideEnvelope):
        box.check_motion(r6.Motion().linear_move(r6.Pose.mm_deg([500, 0, 400]), FAST))


def test_lists_can_be_sent_by_hand(virtual_robot: r6.Robot) -> None:
    accepted = virtual_robot.add_rcc(r6.Motion().axis_move(HOME, FAST), replace=True)
    assert accepted.after > 0 and accepted.points is None
    assert virtual_robot.wait_until_done(timeout=20).axes[4] == pytest.approx(30, abs=0.01)
    virtual_robot.add_rcc(endless_list(), replace=True)
    with pytest.raises(r6.WaitError) as failed:
        virtual_robot.wait_until_done(timeout=0.2)
    assert failed.value.cause == "timed_out"
    virtual_robot.stop()
    assert virtual_robot.clear_list().after > 0


def endless_list() -> r6.Motion:
    return r6.Motion().axis_path([[40], [-40], [40], [-40]], r6.Percent(1))


def test_a_stop_overtakes_another_thread_that_waits(virtual_robot: r6.Robot) -> None:
    handle = virtual_robot.run(endless())
    causes: list[str] = []

    def wait() -> None:
        try:
            handle.finished()
        except r6.MotionError as error:
            causes.append(error.cause)

    thread = threading.Thread(target=wait)
    thread.start()
    assert handle.step(1).started()
    assert virtual_robot.stop().confirmed
    thread.join(10)
    assert causes == ["stopped_here"]


def test_a_motion_is_cut_like_a_list(virtual_robot: r6.Robot) -> None:
    motion = r6.Motion().axis_path([[1], [2], [3], [4]], r6.Percent(50))
    assert [len(part) for part in (motion[1:3], motion[-1], motion[:], motion[9:], motion[0])] == [2, 1, 4, 0, 1]
    assert frames(virtual_robot, motion[1:3]) == frames(virtual_robot, r6.Motion().axis_path([[2], [3]], r6.Percent(50)))
    with pytest.raises(IndexError, match="4 steps"):
        motion[4]
    with pytest.raises(TypeError, match="without leaving steps out"):
        motion[::2]
    with pytest.raises(TypeError, match=r"motion\[2:5\]"):
        motion["1"]  # type: ignore[index]


def frames(robot: r6.Robot, motion: r6.Motion) -> list[dict[str, object]]:
    found = [json.loads(frame) for frame in robot.dry_run(motion)]
    for frame in found:
        del frame["packID"]
    return found
