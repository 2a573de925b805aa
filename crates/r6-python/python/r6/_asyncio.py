"""Waiting for an operation through asyncio."""

from __future__ import annotations

import asyncio
from typing import Any, TypeVar

from ._r6 import Operation

T = TypeVar("T")


async def run(operation: Operation[T]) -> T:
    """What the operation gives. Cancelling the task takes back what can be taken back: a request that has not left."""
    loop = asyncio.get_running_loop()
    future: asyncio.Future[T] = loop.create_future()

    def tell(error: BaseException | None, value: Any) -> None:
        # Called from another thread; a loop that was closed raises here, and nobody waits any more.
        loop.call_soon_threadsafe(settle, future, error, value)

    started = operation.start(tell)
    try:
        return await future
    finally:
        started.cancel()


def settle(future: asyncio.Future[Any], error: BaseException | None, value: Any) -> None:
    """Ends the waiting, if somebody still waits."""
    if future.done():
        return
    if error is None:
        future.set_result(value)
    else:
        future.set_exception(error)
