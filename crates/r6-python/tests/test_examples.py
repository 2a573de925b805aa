"""Each example runs, with a controller of its own and with given ones."""

import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

import r6

EXAMPLES = Path(__file__).parents[1] / "examples"

SAYS = {
    "read_state": "link alive",
    "move": "pose [",
    "stream_path": "500 of 500 points",
    "follow_target": "the arm stands at",
    "two_robots": "stands at",
    "registers": "outputs that are on: [3]",
    "camera_pick": "picked at",
}


def took_a_list(controller: r6.Simulator) -> bool:
    return any(line.text.startswith("AddRCC") for line in controller.log())


DID: dict[str, Callable[[r6.Simulator], bool]] = {
    "read_state": lambda controller: not took_a_list(controller),
    "move": lambda controller: controller.is_on("Y010"),
    "stream_path": took_a_list,
    "follow_target": took_a_list,
    "two_robots": took_a_list,
    "registers": lambda controller: controller.is_on("Y013"),
    "camera_pick": lambda controller: controller.is_on("Y010"),
}
"""What each has done to the controller that it was given."""


def run(name: str, *addresses: str) -> str:
    command = [sys.executable, str(EXAMPLES / f"{name}.py"), *addresses]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr == ""
    return ended.stdout


def test_every_example_is_here() -> None:
    assert {path.stem for path in EXAMPLES.glob("[!_]*.py")} == set(SAYS)


@pytest.mark.parametrize("name", SAYS)
def test_it_brings_its_own_controller(name: str) -> None:
    assert SAYS[name] in run(name)


@pytest.mark.parametrize("name", SAYS)
def test_it_uses_the_controllers_that_are_named(name: str) -> None:
    with ExitStack() as stack:
        program = None
        if name == "camera_pick":
            text = (EXAMPLES / "camera_pick.py").read_text()
            program = text.split('PROGRAM = """')[1].split('"""')[0]
        count = 2 if name == "two_robots" else 1
        started = [stack.enter_context(r6.Simulator(clock=10, program=program)) for _ in range(count)]
        said = run(name, *(controller.address for controller in started))
        assert SAYS[name] in said
        assert all(DID[name](controller) for controller in started)
