"""Fixtures for pytest, available once the package is installed: a virtual controller, and a robot connected
to it.

::

    def test_it_moves(virtual_robot):
        motion = r6.Motion().axis_move(r6.AxisPosition.degrees([10, 0, 0, 0, 30, 0]), r6.Percent(50))
        assert virtual_robot.run(motion).finished().axes[0] == 10

    @pytest.mark.virtual_controller(profile="legacy", clock="max")
    def test_older_firmware(virtual_robot): ...

The arguments of the mark are those of ``r6.Simulator``.
"""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from inspect import signature
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from . import Robot, Simulator


def pytest_configure(config: pytest.Config) -> None:
    """Registers the mark."""
    config.addinivalue_line(
        "markers", "virtual_controller(**arguments): the arguments of r6.Simulator for the fixture of that name"
    )


@pytest.fixture
def virtual_controller(request: pytest.FixtureRequest) -> Iterator[Simulator]:
    """A new virtual controller (``r6.Simulator``), closed at the end of the test."""
    # Imported late, because every run of pytest imports this file.
    from . import Simulator

    mark = request.node.get_closest_marker("virtual_controller")
    arguments = mark.kwargs if mark else {}
    known = list(signature(Simulator).parameters)
    for word in arguments:
        if word not in known:
            near = get_close_matches(word, known, n=1)
            there = f"nearest: `{near[0]}`" if near else f"there are: {', '.join(known)}"
            pytest.fail(f"the mark virtual_controller has no argument `{word}`; {there}", pytrace=False)
    with Simulator(**arguments) as controller:
        yield controller


@pytest.fixture
def virtual_robot(virtual_controller: Simulator) -> Iterator[Robot]:
    """A robot (``r6.Robot``) that is connected to ``virtual_controller``."""
    from . import Robot

    with Robot.connect(virtual_controller.address) as robot:
        yield robot
