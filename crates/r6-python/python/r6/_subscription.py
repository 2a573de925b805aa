"""What a robot sends without a request of the caller: values that are read repeatedly, and events."""

from __future__ import annotations

from collections.abc import Iterator
from types import TracebackType
from typing import TYPE_CHECKING

from ._r6 import PushedCore, SubscriptionCore
from ._types import Event, Snapshot

if TYPE_CHECKING:
    from typing_extensions import Self


class Subscription:
    """Values that are read repeatedly: iterate over it. Closing or dropping it ends the reading."""

    def __init__(self, core: SubscriptionCore) -> None:
        """Use ``Robot.subscribe``."""
        self._core = core

    def latest(self) -> Snapshot:
        """The last known values. If another thread waits for the next values, this waits too. Sends
        nothing."""
        snapshot = self._core.latest().wait()
        if snapshot is None:
            raise RuntimeError("the subscription is closed")
        return snapshot

    def next(self, *, timeout: float | None = None) -> Snapshot | None:
        """Waits until a value was read again, a poll failed, or the connection was lost. Returns ``None``
        once it or the robot is closed, also by another thread. A slow reader gets the latest values.
        Errors: ``TimeoutError``."""
        return self._core.next(timeout).wait()

    def __iter__(self) -> Iterator[Snapshot]:
        """The values whenever there are new ones, until it or the robot is closed."""
        while (snapshot := self.next()) is not None:
            yield snapshot

    def close(self) -> None:
        """Ends it, and every wait for its next values."""
        self._core.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class PushedEvents:
    """Events on a connection, which come without a request: iterate over it."""

    def __init__(self, core: PushedCore) -> None:
        """Use ``Robot.pushed``."""
        self._core = core

    def next(self, *, timeout: float | None = None) -> Event | None:
        """Waits for the next event; ``None`` once the robot is closed. Errors: ``TimeoutError``."""
        return self._core.next(timeout).wait()

    def __iter__(self) -> Iterator[Event]:
        """Each event, until the robot is closed."""
        while (event := self.next()) is not None:
            yield event
