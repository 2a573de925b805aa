"""What the tests share besides the fixtures of the package."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from hostile import Hostile, built
from relay import Relay


@pytest.fixture
def relay() -> Iterator[Relay]:
    """A cable that can be pulled."""
    relay = Relay()
    yield relay
    relay.close()


@pytest.fixture(scope="session")
def hostile_program() -> Path:
    """The program of the hostile controller, built once."""
    return built()


@pytest.fixture
def hostile(hostile_program: Path) -> Iterator[Callable[[dict[str, object]], Hostile]]:
    """Starts controllers that misbehave; each ends with the test."""
    with ExitStack() as stack:
        yield lambda character: stack.enter_context(Hostile(hostile_program, character))
