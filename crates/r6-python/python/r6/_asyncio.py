"""Waiting for an operation through asyncio."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from ._r6 import Operation, Started

T = TypeVar("T")


async def run(operation: Operation[T]) -> T:
    """What the operation gives. Cancelling the task takes back what can be taken back: a request that has not left."""
    return await settled(*started(operation))


def run_at_once(operation: Operation[T]) -> Coroutine[Any, Any, T]:
    """As ``run``, and begun before anybody waits: for a stop, whose task may be cancelled before it has its first turn.

    Outside of an event loop, as in ``asyncio.run(robot.stop())``, it begins with the waiting.
    """
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return run(operation)
    return settled(*started(operation))


def started(operation: Operation[T]) -> tuple[Started, asyncio.Future[T]]:
    """Begins it; the future has what it gives."""
    loop = asyncio.get_running_loop()
    future: asyncio.Future[T] = loop.create_future()

    def tell(error: BaseException | None, value: Any) -> None:
        # Called from another thread; a loop that was closed raises here, and nobody waits any more.
        loop.call_soon_threadsafe(settle, future, error, value)

    return operation.start(tell), future


async def settled(begun: Started, future: asyncio.Future[T]) -> T:
    """What an operation gives that has begun."""
    try:
        return await future
    finally:
        begun.cancel()


def settle(future: asyncio.Future[Any], error: BaseException | None, value: Any) -> None:
    """Ends the waiting, if somebody still waits."""
    if future.done():
        return
    if error is None:
        future.set_result(value)
    else:
        future.set_exception(error)
