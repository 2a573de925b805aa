"""What a robot sends without a request of the caller, for asyncio: the same names as in ``_subscription``."""

from __future__ import annotations

from collections.abc import AsyncIterator
from types import TracebackType
from typing import TYPE_CHECKING

from ._asyncio import run
from ._r6 import PushedCore, SubscriptionCore
from ._types import Event, Snapshot

if TYPE_CHECKING:
    from typing_extensions import Self


class AsyncSubscription:
    """Values that are read repeatedly: ``Subscription`` for asyncio; use ``async for``."""

    def __init__(self, core: SubscriptionCore) -> None:
        """Use ``AsyncRobot.subscribe``."""
        self._core = core

    async def latest(self) -> Snapshot:
        """As ``Subscription.latest``."""
        snapshot = await run(self._core.latest())
        if snapshot is None:
            raise RuntimeError("the subscription is closed")
        return snapshot

    async def next(self, *, timeout: float | None = None) -> Snapshot | None:
        """As ``Subscription.next``. Cancelling it loses nothing."""
        return await run(self._core.next(timeout))

    async def __aiter__(self) -> AsyncIterator[Snapshot]:
        """As iterating over ``Subscription``."""
        while (snapshot := await self.next()) is not None:
            yield snapshot

    def close(self) -> None:
        """As ``Subscription.close``."""
        self._core.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class AsyncPushedEvents:
    """Events on a connection, which come without a request: ``PushedEvents`` for asyncio; use ``async
    for``."""

    def __init__(self, core: PushedCore) -> None:
        """Use ``AsyncRobot.pushed``."""
        self._core = core

    async def next(self, *, timeout: float | None = None) -> Event | None:
        """As ``PushedEvents.next``."""
        return await run(self._core.next(timeout))

    async def __aiter__(self) -> AsyncIterator[Event]:
        """As iterating over ``PushedEvents``."""
        while (event := await self.next()) is not None:
            yield event
