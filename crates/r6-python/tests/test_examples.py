"""Each example runs, with its own controller and with given ones, and does what it says."""

import json
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pick import PROGRAM
from relay import Relay

import r6

EXAMPLES = Path(__file__).parents[1] / "examples"
HOME = [0.0, 0.0, 0.0, 0.0, 30.0, 0.0]

AWAY = [-40.0, 10.0, 5.0, 0.0, -60.0, 15.0]
"""Where arms stand before examples that start at the present position.

No example starts here, so an example that goes elsewhere first swings the arm.
"""

FROM_WHERE_THEY_ARE = {"stream_path", "two_robots"}

SAYS = {
    "read_state": "link alive",
    "move": "pose [",
    "stream_path": "500 of 500 points",
    "follow_target": "the arm stands at",
    "two_robots": "stands at",
    "registers": "Y013 is on: True",
    "camera_pick": "picked at",
}


@dataclass
class Seen:
    """What an example has done to the given controller."""

    said: str
    controller: r6.Simulator
    frames: list[dict[str, Any]]
    """The frames that it sent."""

    @property
    def lists(self) -> list[dict[str, Any]]:
        return [frame for frame in self.frames if frame.get("reqType") == "AddRCC"]

    def commands(self, word: str) -> list[list[str]]:
        """The arguments of each command with this word."""
        sent = [frame["cmdData"] for frame in self.frames if frame.get("reqType") == "command"]
        return [data[1:] for data in sent if data[0] == word]

    @property
    def steps(self) -> list[dict[str, str]]:
        return [step for sent in self.lists for step in sent["instructions"]]

    @property
    def j1(self) -> list[float]:
        """The J1 target of each step."""
        return [float(step["m0"]) for step in self.steps]

    def stands_at(self, axes: list[float]) -> None:
        """Checks that the arm stands there, and that everything that was sent is done."""
        now = self.controller.snapshot()
        assert not now.moving and now.list_length == 0 and now.alarm == 0
        np.testing.assert_allclose(now.axes, axes, atol=0.01)


def read_state(seen: Seen) -> None:
    assert seen.lists == []
    seen.stands_at([0, 0, 0, 0, 0, 0])


def move(seen: Seen) -> None:
    assert [step["action"] for step in seen.steps] == ["4", "10", "200", "100", "10", "200"]
    assert [step.get("io_status") for step in seen.steps if step["action"] == "200"] == ["1", "0"]
    assert not seen.controller.is_on("Y010")
    # Down and up again.
    down, up = (float(seen.steps[step]["m2"]) for step in (1, 4))
    assert up - down == pytest.approx(50, abs=0.01)
    seen.stands_at(HOME)


def stream_path(seen: Seen) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 500)
    np.testing.assert_allclose(seen.j1, AWAY[0] + 20.0 * np.sin(turn), atol=0.001)
    assert max(len(sent["instructions"]) for sent in seen.lists) <= 8
    assert [sent["emptyList"] for sent in seen.lists] == ["1"] + ["0"] * (len(seen.lists) - 1)
    seen.stands_at(AWAY)


def follow_target(seen: Seen) -> None:
    """Each step is sent alone, is slow, and is neither tiny nor large."""
    assert all(sent["emptyList"] == "0" and len(sent["instructions"]) == 1 for sent in seen.lists)
    assert all(float(step["speed"]) == 20 for step in seen.steps)
    assert 2 <= len(seen.steps) <= 100
    assert f"{len(seen.steps)} steps" in seen.said
    sizes = np.abs(np.diff([0.0, *seen.j1]))
    assert 0.99 <= sizes.min() and sizes.max() <= 10.01, sizes
    assert np.abs(seen.j1).max() <= 15.01
    seen.stands_at([seen.j1[-1], 0, 0, 0, 0, 0])


def two_robots(seen: Seen) -> None:
    """There and back, one arm to the left, the other to the right."""
    assert len(seen.lists) == 1 and seen.j1[1] == AWAY[0]
    assert abs(seen.j1[0] - AWAY[0]) == pytest.approx(20)
    seen.stands_at(AWAY)


def registers(seen: Seen) -> None:
    assert seen.lists == []
    assert seen.commands("modifyOutput") == [["0", "3", "1"], ["0", "3", "0"]]
    assert not seen.controller.is_on("Y013")
    assert seen.controller.snapshot().global_speed == 100
    with r6.Robot.connect(seen.controller.address) as robot:
        assert robot.read_registers(810, 3).tolist() == [500_250, -20_500, 300_000]


def camera_pick(seen: Seen) -> None:
    """The arm stands where the photo shows the part: 20, 10, -30 mm from where it was taken."""
    assert seen.lists == [] and seen.controller.is_on("Y010")
    with r6.Simulator(clock="max") as other, r6.Robot.connect(other.address) as robot:
        photo = robot.run(r6.Motion().axis_path([HOME], r6.Percent(50))).finished().pose
    part = seen.controller.snapshot().pose
    np.testing.assert_allclose(part[:3] - photo[:3], [20, 10, -30], atol=0.01)


DID: dict[str, Callable[[Seen], None]] = {
    "read_state": read_state,
    "move": move,
    "stream_path": stream_path,
    "follow_target": follow_target,
    "two_robots": two_robots,
    "registers": registers,
    "camera_pick": camera_pick,
}
"""Checks what each example has done to its controller."""


def run(name: str, *addresses: str) -> str:
    command = [sys.executable, str(EXAMPLES / f"{name}.py"), *addresses]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr == ""
    return ended.stdout


def frames(sent: bytes) -> list[dict[str, Any]]:
    """The sent frames: JSON objects, one after the other."""
    found, text, decoder = [], sent.decode().strip(), json.JSONDecoder()
    while text:
        frame, end = decoder.raw_decode(text)
        text = text[end:].lstrip()
        found.append(frame)
    return found


def test_every_example_is_here() -> None:
    assert {path.stem for path in EXAMPLES.glob("[!_]*.py")} == set(SAYS) == set(DID)


@pytest.mark.parametrize("name", SAYS)
def test_it_brings_its_own_controller(name: str) -> None:
    assert SAYS[name] in run(name)


@pytest.mark.parametrize("name", SAYS)
def test_it_does_what_it_says_with_the_controllers_that_are_named(name: str) -> None:
    program = PROGRAM if name == "camera_pick" else None
    count = 2 if name == "two_robots" else 1
    with ExitStack() as stack:
        controllers = [stack.enter_context(r6.Simulator(clock=10, program=program)) for _ in range(count)]
        # Moves these arms to AWAY first.
        for controller in controllers if name in FROM_WHERE_THEY_ARE else []:
            with r6.Robot.connect(controller.address) as robot:
                robot.run(r6.Motion().axis_path([AWAY], r6.Percent(100))).finished()
        relays = [stack.enter_context(closing(Relay())) for _ in range(count)]
        for relay, controller in zip(relays, controllers, strict=True):
            relay.target = controller.port
        said = run(name, *(relay.address for relay in relays))
        assert SAYS[name] in said
        for relay, controller in zip(relays, controllers, strict=True):
            DID[name](Seen(said, controller, frames(bytes(relay.sent))))
