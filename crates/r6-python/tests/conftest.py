"""Fixtures that the tests share, besides those of the package."""

import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from hostile import Hostile, built
from interrupts import GivenUp
from relay import Relay


@pytest.fixture
def relay() -> Iterator[Relay]:
    """A cable that can be disconnected."""
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


@pytest.fixture
def alarm() -> Iterator[None]:
    """A signal handler that raises at any place in the program, as that of Ctrl-C does."""

    def give_up(number: int, frame: object) -> None:
        raise GivenUp

    before = signal.signal(signal.SIGALRM, give_up)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
