"""The types: stubs agree with the package, mypy accepts examples and tests, and finds wrong units."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.types

ROOT = Path(__file__).parents[1]


def mypy(*arguments: str) -> str:
    """The output of mypy; empty on success."""
    command = [sys.executable, "-m", *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=ROOT / "tests", timeout=600)
    return "" if ended.returncode == 0 else ended.stdout + ended.stderr


def test_the_stubs_say_what_is_there() -> None:
    assert mypy("mypy.stubtest", "r6._r6") == ""


def test_examples_and_package_are_strictly_typed() -> None:
    assert mypy("mypy", "--strict", str(ROOT / "examples"), str(ROOT / "python")) == ""


def test_the_tests_are_typed() -> None:
    """If a test uses a wrong unit on purpose, mypy sees it: an unused ignore is an error."""
    assert mypy("mypy", "--strict", "--warn-unused-ignores", str(ROOT / "tests")) == ""
