"""Reading and writing besides motions."""

import json
import threading
from pathlib import Path

import numpy as np
import pytest

import r6
from hostile import WORKSPACE


def test_a_query_gives_each_value_its_type(virtual_robot: r6.Robot) -> None:
    result = virtual_robot.query("version", "curMode", "axis-0", "input-0", "isMoving", "counterList", "counter-0")
    assert isinstance(result["version"], str) and result.text("version") == result["version"]
    assert result["curMode"] == r6.OperationMode.RUNNING and result.integer("curMode") == 7
    assert result["axis-0"] == 0.0 and isinstance(result["axis-0"], float)
    assert result["isMoving"] is False and result["input-0"] == 0
    assert isinstance(result["counterList"], list)
    assert isinstance(result["counter-0"], r6.Counter)
    assert list(result) == list(dict(result)) and len(result) == 7 and result.took > 0
    assert result.array("axis-0", "curMode", "version").tolist()[:2] == [0.0, 7.0]
    assert np.isnan(result.array("version"))


def test_a_value_that_is_missing_is_never_anothers(virtual_robot: r6.Robot) -> None:
    result = virtual_robot.query("version", "curMold", "axis-0")
    assert "no such value" in result.missing["curMold"] and "curMold" not in result
    assert result["axis-0"] == 0.0 and result.get("curMold") is None
    with pytest.raises(r6.NoReading, match="curMold"):
        result["curMold"]
    with pytest.raises(LookupError, match="not asked"):
        result["axis-1"]
    with pytest.raises(r6.NoReading, match="no number"):
        result.number("version")


def test_an_unknown_address_names_the_nearest(virtual_robot: r6.Robot) -> None:
    with pytest.raises(r6.UnknownAddress, match="curAlarm"):
        virtual_robot.query("curAlarn")
    with pytest.raises(TypeError):
        virtual_robot.query(3)  # type: ignore[arg-type]
    assert len(r6.addresses()) == 26 and r6.addresses()[0].name == "version"


def test_a_status_has_positions_as_arrays(virtual_robot: r6.Robot) -> None:
    status = virtual_robot.status()
    assert status.is_ready and status.unmet == () and status.homed and status.alarm == 0
    # All readable conditions are met. No value says that the program waits for instructions.
    assert status.unproved == ("remote_step",)
    assert status.axes.shape == status.pose.shape == (6,) and status.axes.dtype == np.float64
    assert virtual_robot.firmware() == status.firmware
    identity = virtual_robot.identity()
    assert identity is not None and identity.machine_name == status.machine_name
    virtual_robot.accept_identity(identity)
    with pytest.raises(TypeError):
        virtual_robot.accept_identity("this one")  # type: ignore[arg-type]


def test_a_status_is_the_json_that_the_command_line_prints(
    virtual_controller: r6.Simulator, virtual_robot: r6.Robot
) -> None:
    told = virtual_robot.status().to_dict()
    assert told.pop("robot") == virtual_controller.address
    # The tests of the command line and of the panel use the same file.
    assert told == json.loads((WORKSPACE / "crates/r6-api/tests/status.json").read_text())


@pytest.mark.virtual_controller(model="GENERIC-SCARA")
def test_a_scara_has_four_axes(virtual_robot: r6.Robot) -> None:
    status = virtual_robot.status()
    assert status.axis_count == 4
    axes = status.axes
    assert np.isfinite(axes[:4]).all()


def test_registers_are_written_and_read_back(virtual_robot: r6.Robot) -> None:
    values = np.array([1, -2, 2**31 - 1], np.int64)
    virtual_robot.write_registers(810, values)
    read = virtual_robot.read_registers(810, 3)
    assert read.dtype == np.int64 and (read == values).all()
    virtual_robot.write_registers(813, [7], savable=True, verify=False)
    assert virtual_robot.read_registers(813) == [7]
    for first, count in ((799, 1), (700, 2)):
        with pytest.raises(ValueError, match=f"800 to 900, not {first}"):
            virtual_robot.read_registers(first, count)
    with pytest.raises(ValueError, match="800 to 900"):
        virtual_robot.write_registers(900, [1, 2])
    with pytest.raises(TypeError, match="whole numbers"):
        virtual_robot.write_registers(810, [1.5])  # type: ignore[list-item]
    with pytest.raises(r6.InvalidRequest, match="32 bits"):
        virtual_robot.write_registers(810, [2**31])


@pytest.mark.virtual_controller(scenario='[[fault]]\nfault = "frozen-values"\n')
def test_a_register_that_does_not_take_its_value_is_told(virtual_robot: r6.Robot) -> None:
    with pytest.raises(r6.NotTaken, match="said ok") as error:
        virtual_robot.write_registers(820, [9])
    assert (error.value.register, error.value.wrote, error.value.found) == (820, 9, 0)


@pytest.mark.virtual_controller(profile="r6-host")
def test_a_firmware_that_does_not_tell_registers_is_told(virtual_robot: r6.Robot) -> None:
    with pytest.raises(r6.NotTaken, match="cannot be read") as error:
        virtual_robot.write_registers(820, [9, 8])
    assert (error.value.register, error.value.wrote, error.value.found) == (820, 9, None)
    virtual_robot.write_registers(820, [9], verify=False)
    with pytest.raises(r6.NoReading, match="820"):
        virtual_robot.read_registers(820)
    with pytest.raises(ValueError, match="800 to 900"):
        virtual_robot.write_registers(900, [1, 2], verify=False)
    with pytest.raises(ValueError, match="1 or more"):
        virtual_robot.read_registers(800, 0)


def test_positions_in_registers_are_thousandths(virtual_robot: r6.Robot) -> None:
    virtual_robot.write_registers(810, [r6.to_thousandths(12.5), r6.to_thousandths(-0.0006)])
    assert [r6.from_thousandths(value) for value in virtual_robot.read_registers(810, 2).tolist()] == [12.5, -0.001]
    with pytest.raises(r6.OutOfRange):
        r6.to_thousandths(3e6)


def test_a_guarded_robot_tells_its_envelope(virtual_robot: r6.Robot) -> None:
    envelope = r6.Envelope().speed_cap(r6.Percent(5))
    assert virtual_robot.guard() is None and virtual_robot.with_guard(envelope).guard() == envelope


def test_counters_outputs_inputs_and_speed(virtual_robot: r6.Robot, virtual_controller: r6.Simulator) -> None:
    virtual_robot.set_counter(2, current=4)
    assert virtual_robot.counter(2).current == 4
    with pytest.raises(r6.NoReading):
        virtual_robot.counter(77)
    virtual_robot.set_output("Y013", True)
    assert np.flatnonzero(virtual_robot.outputs()).tolist() == [3] and virtual_controller.is_on("Y013")
    virtual_controller.set_input("X047", True)
    assert virtual_robot.inputs()[31] and virtual_robot.inputs().shape == (32,)
    virtual_robot.set_global_speed(r6.Percent(35))
    assert virtual_controller.snapshot().global_speed == 35


def test_a_command_is_typed_as_on_the_command_line() -> None:
    assert r6.Command.typed("modifyGSPD", 20) == r6.Command.modify_gspd(r6.Percent(20))
    assert r6.Command.typed("modifyOutput", 0, 5, True) == r6.Command.modify_output("Y015", True)
    assert r6.Command.typed("actionStop") == r6.Command.action_stop()
    with pytest.raises(ValueError, match="nearest: `modifyGSPD`"):
        r6.Command.typed("modifyGspd", 20)
    with pytest.raises(ValueError, match="modifyGSPD: .*percent from 0 to 100"):
        r6.Command.typed("modifyGSPD", 200)
    with pytest.raises(ValueError, match="actionStop: .*no argument"):
        r6.Command.typed("actionStop", 1)


def test_commands_say_what_they_are(virtual_robot: r6.Robot) -> None:
    command = r6.Command.modify_output("Y015", True)
    assert command.word == "modifyOutput" and "output" in command.meaning
    assert command == r6.Command.modify_output("Y015", True) != r6.Command.modify_output("Y016", True)
    assert virtual_robot.command(command).after > 0
    assert virtual_robot.pause().after > 0
    for made in (
        r6.Command.action_stop(),
        r6.Command.action_single_cycle(),
        r6.Command.start_button(),
        r6.Command.stop_button(),
        r6.Command.switch_mold("a"),
        r6.Command.modify_counter(0, target=3),
        r6.Command.clear_alarm_run_next(),
        r6.Command.clear_alarm_continue(),
        r6.Command.modify_stack(0, [1, 2, 3], [1, 1, 1]),
        r6.Command.modify_gspd(r6.Percent(5)),
        r6.Command.rewrite_data(800, 1),
        r6.Command.rewrite_data_list(800, [1, 2], savable=True),
        r6.Command.modify_acc_dec(0.2, 0.2),
        r6.Command.switch_tool(1),
        r6.Command.modify_tool(1, [0, 0, 100, 0, 0, 0]),
        r6.Command.switch_coordinate(0),
        r6.Command.clear_alarm(),
        r6.Command.clear_alarm_with(first_line=True, only_alarm=True),
    ):
        assert repr(made).startswith(f"<Command {made.word}") and made.meaning


def test_many_threads_share_a_robot(virtual_robot: r6.Robot) -> None:
    wrong: list[object] = []

    def ask(number: int) -> None:
        for _ in range(50):
            value = virtual_robot.read_registers(800 + number)
            if value != [number]:
                wrong.append(value)

    virtual_robot.write_registers(800, range(8))
    threads = [threading.Thread(target=ask, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_two_robots_are_two(virtual_controller: r6.Simulator) -> None:
    with r6.Simulator(seed=2) as other, r6.Robot.connect(other.address) as second:
        with r6.Robot.connect(virtual_controller.address) as first:
            first.write_registers(800, [1])
            second.write_registers(800, [2])
            assert first.read_registers(800).tolist() == [1]
            assert second.read_registers(800).tolist() == [2]
            assert first.address != second.address and first.address in repr(first)


def test_link_quality_counts(virtual_robot: r6.Robot) -> None:
    assert virtual_robot.link_quality().state == "unknown"
    for _ in range(5):
        virtual_robot.query("curMode")
    quality = virtual_robot.link_quality()
    assert quality.state == "alive" and quality.replies == quality.requests == 5
    assert quality.latency is not None and 0 < quality.latency.p50 <= quality.latency.max


def test_alarms_have_texts() -> None:
    alarm = r6.alarm(135)
    assert (alarm.code, alarm.axis, alarm.known) == (135, 5, True) and "soft limit" in str(alarm)
    assert not r6.alarm(4999).known


def test_settings_are_checked() -> None:
    settings = r6.RobotSettings(reply_timeout=0.5, heartbeat=1)
    assert "reply_timeout=0.5" in repr(settings) and "heartbeat=1" in repr(settings)
    assert "room=24" in repr(r6.RunOptions())
    with pytest.raises(ValueError, match="reply_timeout"):
        r6.RobotSettings(reply_timeout=-1)
    with pytest.raises(ValueError, match="interval"):
        r6.RunOptions(interval=float("nan"))
    with pytest.raises(TypeError):
        r6.RobotSettings(0.5)  # type: ignore[call-arg]


def test_an_address_is_no_robot() -> None:
    """The error for an address, which many users pass, says what to write."""
    for robot, wanted in ((r6.Robot, "Robot.connect('10.0.0.1')"), (r6.AsyncRobot, "await AsyncRobot.connect('10.0.0.1')")):
        with pytest.raises(TypeError) as failed:
            robot("10.0.0.1")  # type: ignore[arg-type]
        assert wanted in str(failed.value)


@pytest.mark.parametrize("every", [0.0, 0.05, 5.5, 20.0, -1.0, float("nan")])
def test_a_heartbeat_that_the_watchdog_does_not_bear_is_refused(every: float) -> None:
    with pytest.raises(ValueError, match="0.1 to 5 s"):
        r6.RobotSettings(heartbeat=every)


def test_the_version_is_told() -> None:
    manifest = (Path(__file__).parents[3] / "Cargo.toml").read_text()
    assert f'\nversion = "{r6.__version__}"\n' in manifest


def test_a_query_of_nothing_is_refused(virtual_robot: r6.Robot) -> None:
    with pytest.raises(r6.InvalidRequest, match="one address at least, such as curMode") as wrong:
        virtual_robot.query()
    assert wrong.value.reason == "value"


def test_points_go_by_their_names(virtual_robot: r6.Robot, virtual_controller: r6.Simulator) -> None:
    virtual_robot.set_output("M1.011", True)
    assert virtual_robot.is_on("M1.011") and virtual_controller.is_on("M1.011") and not virtual_robot.is_on("Y010")
    virtual_controller.set_input("X012", True)
    assert virtual_robot.is_on("X012")
    with pytest.raises(TypeError, match='such as "Y010"'):
        virtual_robot.set_output(0, True)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="X010 is an input"):
        virtual_robot.set_output("X010", True)
    with pytest.raises(ValueError, match="board 0 to 3"):
        virtual_robot.set_output("Y4.010", True)
    with pytest.raises(ValueError, match="no query address tells EU"):
        virtual_robot.is_on("EUX010")


def test_the_pose_is_a_pose(virtual_robot: r6.Robot) -> None:
    status = virtual_robot.status()
    pose = virtual_robot.pose()
    assert [part.value for part in pose.place] == pytest.approx(status.pose[:3], abs=1e-3)
    assert pose.turn is not None


def test_start_is_the_start_button() -> None:
    with r6.Simulator(start="auto") as controller, r6.Robot.connect(controller.address) as robot:
        assert not robot.status().is_ready
        robot.start()
        assert controller.snapshot().mode == 7


def test_a_port_may_stand_apart(virtual_controller: r6.Simulator) -> None:
    host, _, port = virtual_controller.address.partition(":")
    with r6.Robot.connect(host, int(port)) as robot:
        assert robot.address == virtual_controller.address
    with r6.Robot.connect(host, int(port), r6.RobotSettings()) as robot:
        assert robot.status().is_ready
    with pytest.raises(TypeError, match='"192.168.1.10:9760"'):
        r6.Robot.connect(host, port)  # type: ignore[arg-type]
    for twice in (virtual_controller.address, "[::1]:9760"):
        with pytest.raises(ValueError, match="the port was given twice"):
            r6.Robot.connect(twice, int(port))
    with pytest.raises(TypeError, match="given twice"):
        r6.Robot.connect(host, r6.RobotSettings(), r6.RobotSettings())
