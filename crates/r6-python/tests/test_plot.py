"""Motions and files of ``r6 run``, played and drawn without a robot."""

import pickle
from pathlib import Path
from xml.etree import ElementTree

import pytest
import r6

EXAMPLES = Path(__file__).parents[3] / "examples" / "programs"
SPEED = r6.Percent(50)


def to(*angles: float) -> r6.AxisPosition:
    return r6.AxisPosition.degrees(angles)


def test_a_motion_is_drawn(tmp_path: Path) -> None:
    motion = r6.Motion().axis_move(to(30), SPEED).set_output("Y010", True).wait(0.5)
    plot = motion.plot()
    assert plot.trouble is None and 0.5 < plot.duration < 3
    assert ElementTree.fromstring(plot.svg).tag.endswith("svg")
    assert "motion on BRTIRUS0707A" in plot.svg and ">Y010<" in plot.svg
    assert plot.svg == motion.plot().svg == plot._repr_svg_()
    assert repr(plot) == f"<Plot of {plot.duration:.3f} s>"
    plot.save(tmp_path / "motion.svg")
    assert (tmp_path / "motion.svg").read_text() == plot.svg
    with pytest.raises(OSError):
        plot.save(tmp_path / "no" / "motion.svg")
    with pytest.raises(TypeError, match="cannot be pickled"):
        pickle.dumps(plot)


def test_its_conditions_count() -> None:
    motion = r6.Motion().axis_move(to(30), SPEED)
    usual = motion.plot()
    assert motion.plot(global_speed=r6.Percent(25)).duration > 2 * usual.duration
    assert motion.plot(start=to(29)).duration < usual.duration
    assert "on GENERIC-SCARA" in motion.plot(model="GENERIC-SCARA").svg
    assert "profile legacy" in motion.plot(profile="legacy").svg
    assert motion.repeat().plot().svg == usual.svg


def test_trouble_is_told() -> None:
    alarm = r6.Motion().axis_move(to(500), SPEED).plot()
    assert alarm.trouble is not None and "instruction 1 (axis move) ends with alarm 130" in alarm.trouble
    assert alarm.trouble in repr(alarm)
    waits = r6.Motion().wait_for("X010").plot()
    assert waits.trouble is not None and "(wait until X010 is on) waits for ever" in waits.trouble


def test_what_cannot_be_drawn_says_why() -> None:
    motion = r6.Motion().axis_move(to(30), SPEED)
    with pytest.raises(r6.SimulatorError, match="there is no model `BRT`"):
        motion.plot(model="BRT")
    with pytest.raises(r6.SimulatorError, match="there is no profile `hc2`"):
        motion.plot(profile="hc2")
    with pytest.raises(ValueError, match="the start cannot be reached: alarm 130"):
        motion.plot(start=to(500))
    with pytest.raises(ValueError, match="start names an axis that GENERIC-SCARA does not have"):
        motion.plot(model="GENERIC-SCARA", start=to(0, 0, 0, 0, 0, 1))
    many = r6.Motion().axis_path([[0.0]] * 10_001, SPEED)
    with pytest.raises(ValueError, match="10001 instructions are too many"):
        many.plot()
    with pytest.raises(TypeError, match="Percent"):
        motion.plot(global_speed=50)  # type: ignore[arg-type]


def test_a_file_is_drawn_as_r6_plot_does() -> None:
    plot = r6.Program.load(EXAMPLES / "square.toml").plot()
    assert plot.svg == (EXAMPLES.parents[1] / "docs" / "square.svg").read_text()
    text = '[[instruction]]\ndo = "wait"\nseconds = 1\n'
    assert "program on BRTIRUS0707A" in r6.Program.read(text).plot().svg
