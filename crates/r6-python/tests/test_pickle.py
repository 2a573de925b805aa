"""Pickling to another process and back: every error and every value of the package stays the same."""

import copy
import dataclasses
import inspect
import multiprocessing
import pickle
import sys
from typing import Any

import numpy as np
import pytest
from interrupts import endless, told

import r6

def same(one: Any, other: Any) -> bool:
    """Whether two values are the same, arrays and their NaN included."""
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and one.dtype == other.dtype and np.array_equal(one, other, equal_nan=True)
    if dataclasses.is_dataclass(one):
        return type(one) is type(other) and all(
            same(getattr(one, field.name), getattr(other, field.name)) for field in dataclasses.fields(one)
        )
    if isinstance(one, BaseException):
        return type(one) is type(other) and same_error(one, other)
    if isinstance(one, r6.QueryResult):
        return type(one) is type(other) and same([dict(one), one.missing, one.took], [dict(other), other.missing, other.took])
    if isinstance(one, (list, tuple)):
        return type(one) is type(other) and len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, (r6.RobotSettings, r6.RunOptions, r6.FollowOptions)):
        return type(one) is type(other) and same(one.__getnewargs_ex__(), other.__getnewargs_ex__())
    return type(one) is type(other) and bool(one == other)


def same_error(one: BaseException, other: BaseException) -> bool:
    def kept(error: BaseException) -> dict[str, Any]:
        return {name: value for name, value in vars(error).items() if name != "_core"}

    causes = one.__cause__, other.__cause__
    return str(one) == str(other) and same(kept(one), kept(other)) and (causes[0] is causes[1] or same(*causes))


def round_trips(value: Any) -> list[Any]:
    return [
        *(pickle.loads(pickle.dumps(value, protocol)) for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)),
        copy.copy(value),
        copy.deepcopy(value),
    ]


def by_annotation(kind: type) -> Any:
    """A value of a data class with a value in each field."""
    filled: dict[str, Any] = {
        "Floats": np.array([1.0, float("nan")]),
        "bool": True,
        "str": "text",
        "int": 3,
        "float": 0.1,
        "bytes": b"{}",
    }
    values = {}
    for field in dataclasses.fields(kind):
        words = str(field.type).replace("|", " ").replace("[", " ").split()
        values[field.name] = next((filled[word] for word in words if word in filled), "word")
    return kind(**values)


NATIVE: list[Any] = [
    r6.Degrees(0.1 + 0.2),
    r6.Millimetres(-1e-9),
    r6.Percent(33.3),
    r6.MillimetresPerSecond(250),
    r6.AxisMask(0, 6),
    r6.AxisPosition.degrees([1 / 3, -2.5]).with_axis(6, r6.Millimetres(1200.125)),
    r6.AxisPosition(),
    r6.Pose.mm_deg([500, 0, 400.1, 180, 0, 1 / 3]),
    r6.Pose.mm_deg([500, 0, 400.1]),
    r6.RobotSettings(),
    r6.RobotSettings(
        reply_timeout=0.3,
        connect_timeout=7,
        max_frame_bytes=900,
        heartbeat=0.7,
        suspect_after=0.2,
        dead_after=9,
        reconnect_first_wait=0.25,
        reconnect_cap=3,
        reconnect_seed=5,
        type_key="cmdType",
        ds_id="short",
    ),
    r6.RunOptions(),
    r6.RunOptions(
        interval=0.033,
        frame_instructions=2,
        room=5,
        settle=0.7,
        start_within=3,
        stall_within=2,
        idle_mode=9,
        clear_leftover=True,
        stop_on_failure=False,
        stop_on_drop=True,
    ),
    r6.FollowOptions(
        interval=0.07,
        speed=r6.Percent(3),
        smallest_step=r6.Degrees(0.2),
        largest_step=r6.Degrees(4),
        while_moving=True,
        fresh_within=2,
        start_within=3,
        stall_within=4,
        idle_mode=9,
        stop_on_failure=False,
    ),
]

COMMANDS: list[r6.Command] = [
    r6.Command.action_stop(),
    r6.Command.action_pause(),
    r6.Command.action_single_cycle(),
    r6.Command.start_button(),
    r6.Command.stop_button(),
    r6.Command.switch_mold("部件"),
    r6.Command.modify_counter(3, current=5),
    r6.Command.modify_counter(3, target=0),
    r6.Command.modify_output("M047", True),
    r6.Command.clear_alarm_run_next(),
    r6.Command.clear_alarm_continue(),
    r6.Command.modify_stack(1, [1.5, 2, 3], [4, 5, 6]),
    r6.Command.modify_gspd(r6.Percent(5.5)),
    r6.Command.rewrite_data(800, -5, savable=True),
    r6.Command.rewrite_data_list(801, [1, -2], savable=True),
    r6.Command.modify_acc_dec(0.1, 0.2),
    r6.Command.switch_tool(1),
    r6.Command.modify_tool(2, [1, 2, 3, 4, 5, 0.1]),
    r6.Command.switch_coordinate(0),
    r6.Command.clear_alarm(),
    r6.Command.clear_alarm_with(first_line=True, only_alarm=False),
]

ERRORS = [
    kind for _, kind in inspect.getmembers(r6, inspect.isclass) if issubclass(kind, r6.R6Error) and kind.__module__ == "r6"
]
RECORDS = [kind for _, kind in inspect.getmembers(r6, dataclasses.is_dataclass)]


@pytest.mark.parametrize("value", NATIVE + COMMANDS, ids=repr)
def test_a_native_value_comes_back(value: Any) -> None:
    for again in round_trips(value):
        assert same(value, again), again


def test_every_command_is_among_them() -> None:
    public = {name for name in vars(r6.Command) if not name.startswith("_")} - {"word", "meaning", "typed"}
    _, made = zip(*(command.__reduce__() for command in COMMANDS), strict=True)
    assert {name for _, (name, *_) in made} == public


@pytest.mark.parametrize("kind", RECORDS)
def test_a_record_comes_back(kind: type) -> None:
    value = by_annotation(kind)
    for again in round_trips(value):
        assert same(value, again), again


def test_a_result_of_a_query_comes_back(virtual_robot: r6.Robot) -> None:
    result = virtual_robot.query("axis-0", "curMode", "curMold")
    assert result.missing
    for again in round_trips(result):
        assert same(result, again)


@pytest.mark.parametrize("kind", ERRORS)
def test_an_error_comes_back_with_all_that_it_says(kind: type[r6.R6Error]) -> None:
    error = kind("what was wrong")
    for number, name in enumerate(name for parent in kind.__mro__ for name in getattr(parent, "__annotations__", {})):
        setattr(error, name, number)
    error.__cause__ = r6.StepError("a step")
    if sys.version_info >= (3, 11):
        error.add_note("a note")
    for again in round_trips(error):
        assert same(error, again)
        assert told(again) == told(error) and isinstance(again.__cause__, r6.StepError)


def failed(robot: r6.Robot) -> r6.MotionError:
    """The error of a motion that was stopped in its block, with all attributes."""
    with pytest.raises(r6.MotionError) as raised:
        with robot.run(endless()) as handle:
            assert handle.step(1).started()
            robot.stop()
            handle.finished()
    return raised.value


def test_an_error_that_says_what_became_of_the_arm_comes_back(virtual_robot: r6.Robot) -> None:
    error = failed(virtual_robot)
    assert error.progress.total == 2000 and isinstance(error.stop, r6.StopReport)
    for again in round_trips(error):
        assert same(error, again)
        assert again.progress == error.progress and again.stop == error.stop


def raise_in_another_process(address: str) -> None:
    """Work of a worker that fails."""
    with r6.Robot.connect(address) as robot:
        raise failed(robot)


def test_an_error_of_another_process_says_what_became_of_the_arm(virtual_controller: r6.Simulator) -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        with pytest.raises(r6.MotionError) as raised:
            pool.apply_async(raise_in_another_process, (virtual_controller.address,)).get(60)
    assert raised.value.cause == "stopped_here" and raised.value.progress.ended
    assert isinstance(raised.value.stop, r6.StopReport) and raised.value.stop.confirmed


def test_a_motion_and_an_envelope_are_copied_and_go_to_no_other_process(virtual_robot: r6.Robot) -> None:
    motion = r6.Motion().axis_path([[10.0], [1 / 3]], r6.Percent(50))
    envelope = r6.Envelope().speed_cap(r6.Percent(20)).axis_limits(0, r6.Degrees(-90), r6.Degrees(90))
    frames = virtual_robot.dry_run(motion)
    for copied in (copy.copy, copy.deepcopy):
        assert copied(envelope) == envelope
        another = copied(motion)
        assert virtual_robot.dry_run(another) == frames
        another.wait(1)
        assert (len(motion), len(another)) == (2, 3), "it is one of its own"
    for value in (motion, envelope):
        with pytest.raises(TypeError, match="put it together in the process that uses it"):
            pickle.dumps(value)


def test_what_belongs_to_a_connection_goes_nowhere(virtual_robot: r6.Robot) -> None:
    robot = virtual_robot
    for thing in (robot, robot.subscribe("curMode", every=1), robot.pushed(), robot.follow()):
        with pytest.raises(TypeError, match="cannot pickle"):
            pickle.dumps(thing)
