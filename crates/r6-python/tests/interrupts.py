"""Interruptions at chosen moments: a signal at each place of the Python code where a handler can run, a
cancellation at each turn of the event loop."""

from __future__ import annotations

import asyncio
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, Literal

import numpy as np

import r6

PACKAGE = str(Path(r6.__file__).parent)


class GivenUp(BaseException):
    """Raised by a signal handler, as Ctrl-C does."""


def endless() -> r6.Motion:
    """Hours of moves."""
    return r6.Motion().axis_path(np.tile([[40.0], [-40.0]], (1000, 1)), r6.Percent(5))


def stands(controller: r6.Simulator) -> bool:
    """Whether the arm stands and its list is empty."""
    state = controller.snapshot()
    return not state.moving and state.list_length == 0


def until(what: str, holds: Callable[[], bool]) -> None:
    """Waits until something holds, at most a minute."""
    end = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < end, what
        time.sleep(0.001)


def told(error: BaseException) -> str:
    """The text of an exception and its notes; notes exist from Python 3.11 on."""
    return "\n".join([str(error), *getattr(error, "__notes__", [])])


@contextmanager
def interrupted_at(moment: int) -> Iterator[Callable[[], bool]]:
    """Raises ``GivenUp`` in this thread at the n-th moment at which a signal handler could run in Python code
    of the package: at the start of a function, and after a native call. Yields a function that says
    whether this happened."""
    seen, raised = 0, False

    def watch(frame: FrameType, event: str, _: Any) -> None:
        nonlocal seen, raised
        if raised or event not in ("call", "c_return") or not frame.f_code.co_filename.startswith(PACKAGE):
            return
        seen += 1
        if seen > moment:
            raised = True
            raise GivenUp

    before = sys.getprofile()
    sys.setprofile(watch)
    try:
        yield lambda: raised
    finally:
        sys.setprofile(before)


class Loop(asyncio.SelectorEventLoop):
    """An event loop that does something when a thread reports an operation that has ended: before it takes
    the report (``early``), after that and before anything else (``late``), or instead (``lost``), which
    fails as on a closed loop."""

    def __init__(self) -> None:
        super().__init__()
        self.on_news: tuple[Literal["early", "late", "lost"], Callable[[], object]] | None = None

    def call_soon_threadsafe(self, callback: Any, *args: Any, context: Any = None) -> asyncio.Handle:  # type: ignore[override]
        news = self.on_news
        if news is None or threading.current_thread() is threading.main_thread():
            return super().call_soon_threadsafe(callback, *args, context=context)
        when, disturb = news
        if when != "late":
            super().call_soon_threadsafe(disturb)
        if when == "lost":
            raise RuntimeError("Event loop is closed")

        def taken_in() -> None:
            callback(*args)
            if when == "late":
                # Still in the same turn: the waiting task has its turn after it.
                disturb()

        return super().call_soon_threadsafe(taken_in, context=context)
