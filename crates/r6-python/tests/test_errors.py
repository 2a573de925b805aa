"""Errors, sorted by what to do next."""

import pickle

import pytest
from logged import lists
from relay import Relay

import r6


def test_the_tree_is_sorted_by_what_to_do() -> None:
    assert issubclass(r6.OutsideEnvelope, r6.InvalidRequest) and issubclass(r6.NotReady, r6.MotionError)
    assert issubclass(r6.InvalidRequest, ValueError) and not issubclass(r6.InvalidRequest, r6.NotSent)
    for kind in (r6.InvalidRequest, r6.NotSent, r6.Refused, r6.OutcomeUnknown):
        assert issubclass(kind, r6.RequestError) and kind.__module__ == "r6"
    for root in (r6.RequestError, r6.MotionError, r6.WaitError, r6.StepError, r6.NoReading, r6.SimulatorError):
        assert issubclass(root, r6.R6Error)


def test_nobody_there_is_not_sent() -> None:
    with r6.Simulator() as controller:
        address = controller.address
    with pytest.raises(r6.NotSent, match="cannot be reached") as error:
        r6.Robot.connect(address)
    assert error.value.reason == "unreachable" and error.value.may_send_again
    again = pickle.loads(pickle.dumps(error.value))
    assert type(again) is r6.NotSent and again.reason == "unreachable"


def test_a_fault_of_the_caller_may_not_be_sent_again(virtual_robot: r6.Robot) -> None:
    with pytest.raises(r6.InvalidRequest, match="no address") as address:
        r6.Robot.connect("not an address")
    assert (address.value.reason, address.value.may_send_again) == ("bad_address", False)
    with pytest.raises(r6.InvalidRequest, match="32 bits") as value:
        virtual_robot.write_registers(810, [2**31])
    assert (value.value.reason, value.value.may_send_again) == ("value", False)
    twenty = r6.Motion()
    for degrees in range(20):
        twenty = twenty.axis_move(r6.AxisPosition.degrees([degrees]), r6.Percent(10))
    with pytest.raises(r6.InvalidRequest, match="2048") as long:
        virtual_robot.add_rcc(twenty, replace=True)
    assert (long.value.reason, long.value.may_send_again) == ("too_long", False)
    guarded = virtual_robot.with_guard(r6.Envelope().axis_limits(0, r6.Degrees(-90), r6.Degrees(90)))
    far = r6.Motion().axis_move(r6.AxisPosition.degrees([100]), r6.Percent(10))
    with pytest.raises(r6.OutsideEnvelope) as beyond:
        guarded.add_rcc(far, replace=True)
    assert (beyond.value.reason, beyond.value.may_send_again) == ("outside_envelope", False)


def test_a_closed_handle_says_so(virtual_robot: r6.Robot) -> None:
    virtual_robot.close()
    virtual_robot.close()
    with pytest.raises(r6.NotSent, match="closed") as error:
        virtual_robot.status()
    assert error.value.reason == "closed"


def test_a_refusal_is_a_no(virtual_robot: r6.Robot, virtual_controller: r6.Simulator) -> None:
    virtual_controller.turn_key("stop")
    with pytest.raises(r6.Refused, match="instruction list") as error:
        virtual_robot.add_rcc(r6.Motion().wait(1), replace=True)
    assert not error.value.may_send_again


@pytest.mark.virtual_controller(scenario='[[fault]]\nfault = "not-acknowledged"\n')
def test_a_motion_without_a_reply_is_never_sent_again(virtual_controller: r6.Simulator) -> None:
    settings = r6.RobotSettings(reply_timeout=0.2)
    with r6.Robot.connect(virtual_controller.address, settings) as robot:
        with pytest.raises(r6.OutcomeUnknown, match="Do not send it again") as error:
            robot.add_rcc(r6.Motion().axis_move(r6.AxisPosition.degrees([5]), r6.Percent(10)), replace=True)
        assert (error.value.reason, error.value.request) == ("timed_out", "AddRCC")
        assert error.value.effect == "moves" and not error.value.may_send_again
        assert len(lists(virtual_controller.log())) == 1, "it came once, and was carried out"


def test_what_follows_a_lost_connection(relay: Relay, virtual_controller: r6.Simulator) -> None:
    relay.target = virtual_controller.port
    with r6.Robot.connect(relay.address) as robot:
        events = robot.pushed()
        robot.status()
        relay.cut()
        assert isinstance(events.next(timeout=10), r6.ConnectionLost)
        with pytest.raises(r6.NotSent) as error:
            robot.set_output("Y010", True)
        assert error.value.reason in ("disconnected", "state_not_read")
        assert robot.status().is_ready
        found = events.next(timeout=10)
        assert isinstance(found, r6.Reconnected) and not found.another and found.mode == 7
        robot.set_output("Y010", True)
        assert virtual_controller.is_on("Y010") and robot.link_quality().reconnects == 1


def test_another_robot_at_the_same_address_gets_no_command(
    relay: Relay, virtual_controller: r6.Simulator
) -> None:
    relay.target = virtual_controller.port
    with r6.Simulator(model="BRTIRUS1820A") as other, r6.Robot.connect(relay.address) as robot:
        robot.status()
        relay.target = other.port
        relay.cut()
        events = robot.pushed()
        with pytest.raises(r6.OutcomeUnknown, match="another robot") as unread:
            robot.status()
        assert unread.value.reason == "another_robot" and unread.value.effect == "reads"
        found = events.next(timeout=10)
        while not isinstance(found, r6.Reconnected):
            found = events.next(timeout=10)
        assert found.another and unread.value.found == found.identity != unread.value.expected
        with pytest.raises(r6.NotSent, match="another robot") as error:
            robot.clear_list()
        assert error.value.reason == "another_robot" and error.value.found == found.identity
        assert error.value.expected != error.value.found and error.value.found is not None
        robot.accept_identity(error.value.found)
        robot.status()
        robot.clear_list()
