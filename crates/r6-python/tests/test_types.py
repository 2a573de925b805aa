"""The types: stubs agree with what is there, mypy is content with examples and tests, and finds mistakes in units."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.types

ROOT = Path(__file__).parents[1]


def mypy(*arguments: str) -> str:
    """What it says; nothing but success if it is content."""
    command = [sys.executable, "-m", *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=ROOT / "tests", timeout=600)
    return "" if ended.returncode == 0 else ended.stdout + ended.stderr


def test_the_stubs_say_what_is_there() -> None:
    assert mypy("mypy.stubtest", "r6._r6") == ""


def test_examples_and_package_are_strictly_typed() -> None:
    assert mypy("mypy", "--strict", str(ROOT / "examples"), str(ROOT / "python")) == ""


def test_the_tests_are_typed() -> None:
    """Where a test makes a mistake in a unit on purpose, mypy sees it: an ignore that is not needed is an error."""
    assert mypy("mypy", "--strict", "--warn-unused-ignores", str(ROOT / "tests")) == ""
