"""The addresses for the examples: those on the command line, else of virtual controllers that this starts."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import r6


@contextmanager
def addresses(count: int = 1) -> Iterator[list[str]]:
    """The addresses of ``count`` controllers."""
    given = sys.argv[1:]
    if given and len(given) != count:
        sys.exit(f"usage: {sys.argv[0]} [HOST:PORT]{' HOST:PORT' * (count - 1)}")
    with ExitStack() as stack:
        missing = 0 if given else count
        started = [stack.enter_context(r6.Simulator(clock=10)) for _ in range(missing)]
        yield given or [controller.address for controller in started]
