"""Values with units."""

import array
import datetime
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import r6

SPEED = r6.Percent(50)


def test_lengths_add_up_and_angles_do() -> None:
    assert r6.Millimetres(400) + r6.Millimetres(2.5) == r6.Millimetres(402.5)
    assert -(r6.Degrees(90) - r6.Degrees(100)) * 2 == r6.Degrees(20)
    assert abs(r6.Degrees(-3)) == r6.Degrees(3) < r6.Degrees(4)
    assert str(r6.Millimetres(2.5)) == "2.5 mm" and repr(r6.Degrees(2)) == "Degrees(2.0)"
    assert hash(r6.Degrees(0.0)) == hash(r6.Degrees(-0.0))
    assert 2 * r6.Millimetres(2) == r6.Millimetres(4)


def test_a_unit_mistake_is_a_type_error() -> None:
    motion = r6.Motion()
    here = r6.AxisPosition.degrees([0, 0])
    with pytest.raises(TypeError):
        r6.Degrees(1) + r6.Millimetres(1)  # type: ignore[operator]
    with pytest.raises(TypeError):
        r6.Degrees(1) + 1  # type: ignore[operator]
    with pytest.raises(TypeError):
        motion.axis_move(here, 20)  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        motion.axis_move(here, r6.MillimetresPerSecond(20))  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        motion.linear_move(here, SPEED)  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        r6.Pose.position(1, 2, 3)  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        r6.AxisPosition().with_axis(0, 5.0)  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        r6.Envelope().axis_limits(0, r6.Degrees(0), r6.Millimetres(5))
    assert len(motion) == 0
    assert r6.Degrees(1) != r6.Millimetres(1)


def test_a_plain_number_is_answered_with_what_to_write() -> None:
    here: Any = r6.AxisPosition.degrees([0])
    number: Any = 20
    cases: list[tuple[Callable[[], object], str]] = [
        (lambda: r6.Motion().axis_move(here, number), "r6.Percent(20)"),
        (lambda: r6.Motion().axis_move(number, SPEED), "r6.AxisPosition.degrees([20])"),
        (lambda: r6.Motion().linear_move(number, SPEED), "r6.Pose.mm_deg([x, y, z])"),
        (lambda: r6.Motion().path_speed(number), "r6.MillimetresPerSecond(20)"),
        (lambda: r6.Pose.position(number, number, number), "r6.Millimetres(20)"),
        (lambda: here.with_axis(0, number), "r6.Degrees(20) or r6.Millimetres(20)"),
        (lambda: r6.Envelope().largest_axis_step(number), "r6.Degrees(20)"),
        (lambda: r6.FollowOptions(speed=number), "r6.Percent(20)"),
        (lambda: r6.Command.modify_gspd(number), "r6.Percent(20)"),
    ]
    for call, write in cases:
        with pytest.raises(TypeError) as wrong:
            call()
        assert str(wrong.value).endswith(f"not the plain number 20, whose unit is unknown: write {write}")
    text: Any = "20"
    with pytest.raises(TypeError, match="Percent is wanted, not str"):
        r6.Motion().axis_move(here, text)


@pytest.mark.parametrize("bad", [0, -1, 100.1, float("nan"), float("inf")])
def test_a_percentage_is_above_zero_and_at_most_all(bad: float) -> None:
    with pytest.raises(r6.OutOfRange, match="from 0.1 to 100") as error:
        r6.Percent(bad)
    assert error.value.wanted and isinstance(error.value, ValueError) and error.value.nearest is None


def test_what_lies_between_two_steps_of_the_wire_is_refused_with_both(virtual_robot: r6.Robot) -> None:
    with pytest.raises(r6.OutOfRange, match="nearest: 5.5 or 5.6") as speed:
        r6.Percent(5.55)
    assert speed.value.nearest == (5.5, 5.6)
    assert r6.Percent(0.1 + 0.2).value == pytest.approx(0.3), "the noise of floating point passes"
    with pytest.raises(r6.InvalidRequest, match="nearest: 0 or 0.001") as tool:
        virtual_robot.command(r6.Command.modify_tool(1, [0.0004, 0, 0, 0, 0, 0]))
    assert (tool.value.reason, tool.value.nearest) == ("value", (0, 0.001))
    with pytest.raises(r6.InvalidRequest, match="deceleration"):
        virtual_robot.command(r6.Command.modify_acc_dec(0.25, 0.2505))
    home = r6.AxisPosition.degrees([0, 0, 0, 0, 30, 0])
    with pytest.raises(r6.StepError, match="nearest: 0.2 or 0.3") as delay:
        r6.Motion().axis_move(home, SPEED).delay(0.25)
    assert delay.value.nearest == (0.2, 0.3)
    with pytest.raises(r6.StepError, match="steps of 0.1 seconds"):
        r6.Motion().wait(0.05)
    # A position is usually computed, so a value finer than the wire is rounded.
    assert virtual_robot.run(r6.Motion().axis_move(r6.AxisPosition.degrees([1 / 3]), SPEED)).finished().moved


def test_a_path_speed_is_a_whole_number() -> None:
    assert r6.MillimetresPerSecond(250).value == 250
    with pytest.raises(TypeError):
        r6.MillimetresPerSecond(20.5)  # type: ignore[arg-type]
    with pytest.raises(r6.OutOfRange):
        r6.MillimetresPerSecond(0)


def test_positions_take_arrays_and_name_their_axes() -> None:
    position = r6.AxisPosition.degrees(np.array([1, 2, 3], np.float32))
    assert position.at(1) == r6.Degrees(2) and position.at(3) is None
    rail = position.with_axis(6, r6.Millimetres(1200))
    assert rail.at(6) == r6.Millimetres(1200) and rail.mask == r6.AxisMask(0, 1, 2, 6)
    assert 6 in rail.mask and rail.mask.axes == [0, 1, 2, 6] and rail.mask.bits == 0b100_0111
    for wrong in ([], [0.0] * 9, [[0.0]]):
        with pytest.raises(ValueError):
            r6.AxisPosition.degrees(wrong)
    with pytest.raises(ValueError, match="J8"):
        position.at(8)


def test_an_angle_is_told_as_near_as_it_can_be() -> None:
    """A wrist at U −180 that is sent to +180 makes a full turn."""
    assert r6.Degrees(180).nearest_to(r6.Degrees(-179.5)) == r6.Degrees(-180)
    assert r6.Degrees(10).nearest_to(r6.Degrees(20)) == r6.Degrees(10)
    present = (r6.Degrees(-180), r6.Degrees(0), r6.Degrees(180))
    pose = r6.Pose.mm_deg([500, 0, 400, 180, 0, -180])
    assert pose.nearest_to(present) == r6.Pose.mm_deg([500, 0, 400, -180, 0, 180])
    place = r6.Pose.mm_deg([500, 0, 400])
    assert place.nearest_to(present) == place
    with pytest.raises(TypeError):
        pose.nearest_to((-180.0, 0.0, 180.0))  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        r6.Degrees(1).nearest_to(r6.Millimetres(1))  # type: ignore[arg-type]


def test_a_pose_has_three_or_six_components() -> None:
    pose = r6.Pose.mm_deg([500, 0, 400, 180, 0, 0])
    x, y, z = (r6.Millimetres(value) for value in (500, 0, 400))
    u, v, w = (r6.Degrees(value) for value in (180, 0, 0))
    assert pose == r6.Pose(x, y, z, u, v, w) and pose.turn == (u, v, w)
    assert r6.Pose.mm_deg([500, 0, 400]) == r6.Pose.position(x, y, z)
    assert r6.Pose.position(x, y, z).turn is None
    with pytest.raises(ValueError, match="3 or 6"):
        r6.Pose.mm_deg([1, 2])


class OneDegree:
    """An object that converts to a number, but is no number to numpy."""

    def __float__(self) -> float:
        return 1.0


@pytest.mark.parametrize(
    "wrong",
    [
        ["1", "2"],
        "12",
        b"12",
        [b"1", b"2"],
        bytearray(b"12"),
        pytest.param(memoryview(b"12"), id="memoryview"),
        [True, False],
        [1.0, True],
        [1.0, np.bool_(True)],
        np.array([True, False]),
        [1.0, "2"],
        np.array(["1", "2"]),
        np.array([1.0, "2"], dtype=object),
        np.array([1.0, True], dtype=object),
        [datetime.date(2026, 1, 1)] * 2,
        [datetime.timedelta(1)] * 2,
        [datetime.time(1)] * 2,
        np.array(["2026-01-01", "2026-01-02"], dtype="datetime64[D]"),
        np.array([1, 2], dtype="timedelta64[s]"),
        [np.timedelta64(1, "s"), np.timedelta64(2, "s")],
        [1.0, np.timedelta64(2, "s")],
        np.array([1j, 2j]),
        np.ma.masked_array([1.0, 2.0], mask=[False, True]),
        [1.0, np.ma.masked],
        [None, 1.0],
        [r6.Degrees(1), r6.Degrees(2)],
    ],
    ids=repr,
)
def test_what_only_looks_like_numbers_is_no_angle(wrong: Any) -> None:
    with pytest.raises(TypeError):
        r6.AxisPosition.degrees(wrong)
    with pytest.raises(TypeError):
        r6.Motion().axis_path([wrong, wrong], SPEED)
    with pytest.raises(TypeError):
        r6.Motion().linear_path(wrong, SPEED)


def test_rows_with_masked_elements_are_refused_and_others_are_taken() -> None:
    path = np.ma.masked_array(np.zeros((4, 2)), mask=False)
    assert len(r6.Motion().axis_path(path, SPEED)) == 4
    path[2, 1] = np.ma.masked
    with pytest.raises(TypeError, match="masked"):
        r6.Motion().axis_path(path, SPEED)
    with pytest.raises(TypeError, match="masked"):
        r6.Motion().axis_path([path[1], path[2]], SPEED)
    with pytest.raises(TypeError, match="numbers"):
        r6.Motion().axis_path([[1.0, 2.0], [1.0, True]], SPEED)


@pytest.mark.parametrize(
    "right",
    [
        [1, 2.0],
        (1, np.float32(2)),
        np.array([1, 2], np.uint8),
        [np.int64(1), np.array(2.0)],
        range(1, 3),
        array.array("d", [1, 2]),
        [Fraction(1), Decimal(2)],
        np.array([1, 2], dtype=object),
        np.ma.masked_array([1, 2], mask=[False, False]),
    ],
    ids=repr,
)
def test_numbers_of_every_kind_are_angles(right: Any) -> None:
    assert r6.AxisPosition.degrees(right) == r6.AxisPosition.degrees([1, 2])


@pytest.mark.parametrize("kind", [r6.Degrees, r6.Millimetres, r6.Percent, r6.MillimetresPerSecond])
def test_one_number_is_a_number(kind: Any) -> None:
    wrongs = (True, np.bool_(True), "1", np.str_("1"), b"1", np.timedelta64(1, "s"), np.ma.masked, None, [1])
    for wrong in wrongs:
        with pytest.raises(TypeError):
            kind(wrong)
    assert kind(np.int32(1)).value == 1.0 and kind(1).value == 1.0
    if kind is not r6.MillimetresPerSecond:
        assert kind(np.float32(1)).value == 1.0 and kind(OneDegree()).value == 1.0


def test_what_is_no_number_of_degrees_is_refused_where_it_is_to_go() -> None:
    with pytest.raises(r6.StepError):
        r6.Motion().axis_move(r6.AxisPosition.degrees([float("nan")]), SPEED)
    with pytest.raises(r6.StepError):
        r6.Motion().axis_path([[float("inf")]], SPEED)
