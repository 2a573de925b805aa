"""The virtual controller, and the fixtures."""

import socket
import subprocess
import sys
from pathlib import Path

import pytest

import r6


def test_a_person_at_the_machine() -> None:
    with r6.Simulator(clock="max", seed=3) as controller, r6.Robot.connect(controller.address) as robot:
        controller.emergency_stop()
        assert robot.status().alarm == 7 and controller.snapshot().emergency_stop
        with pytest.raises(r6.PanelRefused, match="emergency stop") as error:
            controller.press("start")
        assert error.value.code == "emergency_stop"
        controller.release_emergency_stop()
        controller.clear_alarm()
        controller.turn_key("manual")
        controller.jog(0, 5.0, percent=50)
        assert controller.snapshot().axes[0] == pytest.approx(5)
        controller.home()
        controller.turn_key("auto")
        controller.press("start")
        assert robot.status().is_ready
        controller.raise_alarm(5001)
        assert robot.query("curAlarm")["curAlarm"] == 5001
        assert any(line.event.get("alarm") == 5001 for line in controller.log()) and controller.log() == []
        assert str(controller.port) in controller.address and controller.address in repr(controller)
        with pytest.raises(ValueError, match="single_step"):
            controller.press("go")  # type: ignore[arg-type]
        with pytest.raises(ValueError, match="no input"):
            controller.set_input("Y010", True)


def test_it_is_gone_when_it_is_closed() -> None:
    controller = r6.Simulator()
    controller.close()
    controller.close()
    with pytest.raises(RuntimeError, match="closed"):
        controller.snapshot()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", controller.port))


def test_programs_and_scenarios_from_texts_and_files(tmp_path: Path) -> None:
    program = '[[step]]\ndo = "wait"\npoint = "X010"\n[[step]]\ndo = "output"\npoint = "Y010"\non = true\n'
    file = tmp_path / "gripper.toml"
    file.write_text(program)
    scenario = '[[react]]\nwhen = "Y010"\nthen = "X012"\n'
    for given in (program, file):
        with r6.Simulator(program=given, scenario=scenario, clock="max") as controller:
            assert not controller.is_on("Y010")
            controller.set_input("X010", True)
            assert controller.is_on("Y010") and controller.is_on("X012")


def test_it_keeps_its_state_in_a_folder(tmp_path: Path) -> None:
    for wanted in (None, 7):
        with r6.Simulator(state=tmp_path) as controller, r6.Robot.connect(controller.address) as robot:
            if wanted is None:
                robot.set_counter(2, current=7)
            else:
                assert robot.counter(2).current == wanted


def test_a_state_that_cannot_be_written_is_raised_at_the_end(tmp_path: Path) -> None:
    # A folder has the name of the new file before anything is written.
    (tmp_path / "controller-1.json.new").mkdir()
    controller = r6.Simulator(state=tmp_path)
    controller.turn_key("manual")
    with pytest.raises(r6.SimulatorError, match="cannot be written"):
        controller.close()
    controller.close()


def test_what_is_wrong_with_its_arguments_is_told(tmp_path: Path) -> None:
    with pytest.raises(r6.SimulatorError, match="hc1, r6-host"):
        r6.Simulator(profile="hc2")
    with pytest.raises(r6.SimulatorError, match="BRTIRUS0707A"):
        r6.Simulator(model="nothing")
    with pytest.raises(r6.SimulatorError, match="real, 10x"):
        r6.Simulator(clock="fast")
    with pytest.raises(r6.SimulatorError, match="step 1"):
        r6.Simulator(program='[[step]]\ndo = "dance"\n')
    with pytest.raises(r6.SimulatorError):
        r6.Simulator(scenario="seed = 'x'")
    with pytest.raises(r6.SimulatorError):
        r6.Simulator(cameras=["nowhere"])
    with pytest.raises(ValueError, match="waiting"):
        r6.Simulator(start="asleep")  # type: ignore[arg-type]
    with pytest.raises(FileNotFoundError):
        r6.Simulator(profile=tmp_path / "none.toml")
    with pytest.raises(TypeError):
        r6.Simulator(profile=3)  # type: ignore[arg-type]
    assert "hc1" in r6.profiles() and "BRTIRUS0707A" in r6.models()


def test_a_file_may_be_a_str_or_a_path(tmp_path: Path) -> None:
    file = tmp_path / "my-pick.toml"
    file.write_text('[[step]]\ndo = "remote"\n')
    for given in (file, str(file)):
        with r6.Simulator(program=given) as controller:
            assert controller.snapshot().program == "my-pick"
    profile = tmp_path / "mine.toml"
    profile.write_text('name = "mine"\n')
    with r6.Simulator(profile=str(profile)) as controller:
        assert controller.snapshot().profile == "mine"


def test_a_word_that_is_no_program_is_told_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(r6.SimulatorError, match="there is no program `pick-and-plce`; nearest: `pick-and-place`"):
        r6.Simulator(program="pick-and-plce")
    with pytest.raises(r6.SimulatorError, match="there is no program `xyz 123`; there are: .*remote"):
        r6.Simulator(program="xyz 123")
    with pytest.raises(r6.SimulatorError, match="there is no scenario `flood` .the name of a file ends with .toml"):
        r6.Simulator(scenario="flood")
    missing = tmp_path / "missing.toml"
    with pytest.raises(FileNotFoundError) as caught:
        r6.Simulator(program=str(missing))
    assert str(missing) in str(caught.value)
    with pytest.raises(FileNotFoundError) as caught:
        r6.Simulator(program="in-no-folder.toml")
    assert str(Path.cwd() / "in-no-folder.toml") in str(caught.value)


@pytest.mark.virtual_controller(profile="legacy", start="manual")
def test_the_mark_gives_the_fixture_its_arguments(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    assert virtual_controller.snapshot().profile == "legacy"
    assert virtual_robot.status().mode == r6.OperationMode.MANUAL


def test_each_test_has_a_fresh_controller(virtual_controller: r6.Simulator) -> None:
    assert virtual_controller.snapshot().profile == "hc1" and virtual_controller.snapshot().connections == 0


def test_every_mistake_of_a_file_is_told_with_its_place(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text('seed = -1\n[[at]]\ntime = -1\ndo = "fhoto"\n[[react]]\nwhen = "X010"\nthen = "Y010"\n')
    with pytest.raises(r6.SimulatorError) as caught:
        r6.Simulator(scenario=file)
    places = [(mistake.line, mistake.column) for mistake in caught.value.mistakes]
    assert places == [(1, 8), (3, 8), (4, 6), (6, 8), (7, 8)]
    assert [line for line in str(caught.value).splitlines() if line.startswith(f"{file}:4:6: ")]
    assert caught.value.mistakes[2].advice == 'nearest: "photo"' and caught.value.more == 0


def test_a_mark_with_a_misspelt_argument_is_told_the_nearest(tmp_path: Path) -> None:
    file = tmp_path / "test_misspelt.py"
    file.write_text(
        "import pytest\n\n"
        "@pytest.mark.virtual_controller(profle='legacy')\n"
        "def test_it(virtual_controller): ...\n"
    )
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(tmp_path), str(file)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 1, run.stdout + run.stderr
    assert "the mark virtual_controller has no argument `profle`; nearest: `profile`" in run.stdout
