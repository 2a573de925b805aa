"""Waits for an operation through asyncio."""

from __future__ import annotations

import asyncio
import logging
import sys
from collections.abc import Coroutine
from typing import Any, TypeVar

from ._r6 import FollowCore, MotionCore, Operation, Started, told

T = TypeVar("T")

LOGGER = logging.getLogger("r6")


async def run(operation: Operation[T]) -> T:
    """The result of the operation. Cancelling the task withdraws a request that has not left."""
    return await settled(*started(operation))


def run_at_once(operation: Operation[T]) -> Coroutine[Any, Any, T]:
    """As ``run``, but the call itself begins the operation: for a stop, whose task may be cancelled before
    its first turn.

    Outside of an event loop, as in ``asyncio.run(robot.stop())``, it begins with the wait.
    """
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return run(operation)
    return settled(*started(operation))


def started(operation: Operation[T]) -> tuple[Started, asyncio.Future[T]]:
    """Begins the operation; the future gets its result."""
    loop = asyncio.get_running_loop()
    future: asyncio.Future[T] = loop.create_future()

    def tell(error: BaseException | None, value: Any) -> None:
        # Called from another thread. A closed loop raises here; then no task waits.
        loop.call_soon_threadsafe(settle, future, error, value)

    return operation.start(tell, loop, future), future


async def settled(begun: Started, future: asyncio.Future[T]) -> T:
    """The result of an operation that has begun."""
    try:
        return await future
    except BaseException as error:
        if begun.goes_on is not None and (future.cancelled() or not future.done()):
            note(error, begun.goes_on)
        raise
    finally:
        begun.cancel()


async def stop_for(core: MotionCore | FollowCore, error: BaseException) -> None:
    """Stops the arm, because this exception ends the block of its motion, and adds the result to the
    exception.

    Errors: that of a stop that failed; the interruption of the wait, once the stop has ended.
    """
    await told_to(error, core, core.stop())


async def told_to(
    error: BaseException,
    core: MotionCore | FollowCore | None,
    stopping: Operation[Any],
    why: str | None = None,
) -> None:
    """Waits for a stop to its end, through all cancellations of the task, and adds the result to this
    exception."""
    if isinstance(error, GeneratorExit):
        # The coroutine is being closed and cannot wait. The stop goes on.
        stopping.start(lambda *_: None)
        return
    _, future = started(stopping)
    interrupted: BaseException | None = None
    while not future.done():
        try:
            await asyncio.wait([future])
        except GeneratorExit:
            raise
        except BaseException as again:
            interrupted = again
    report = future.exception() or future.result()
    if report is None:
        return
    if why is not None:
        note(error, why)
    told(core, error, report)
    if isinstance(error, asyncio.CancelledError):
        # A task group drops the exception that has the note, and asyncio.run raises another one for Ctrl-C.
        LOGGER.warning("a task was cancelled while its motion ran: %s", getattr(report, "text", report))
    if interrupted is not None:
        told(core, interrupted, report)
        raise interrupted


def note(error: BaseException, text: str) -> None:
    """Adds a line below the error. Python shows it from 3.11 on."""
    if sys.version_info >= (3, 11):
        error.add_note(text)


def settle(future: asyncio.Future[Any], error: BaseException | None, value: Any) -> None:
    """Ends the wait, if a task still waits."""
    if future.done():
        return
    if error is None:
        future.set_result(value)
    else:
        future.set_exception(error)
