"""What comes from a robot by itself: values that are read again and again, and events."""

from __future__ import annotations

from collections.abc import Iterator
from types import TracebackType
from typing import TYPE_CHECKING

from ._r6 import PushedCore, SubscriptionCore
from ._types import Event, Snapshot

if TYPE_CHECKING:
    from typing_extensions import Self


class Subscription:
    """Values that are read again and again: iterate over it. Closing or dropping it ends that."""

    def __init__(self, core: SubscriptionCore) -> None:
        """Use ``Robot.subscribe``."""
        self._core = core

    def latest(self) -> Snapshot:
        """The values as they are known now; if another thread waits for the next ones, then. Sends nothing."""
        snapshot = self._core.latest().wait()
        if snapshot is None:
            raise RuntimeError("the subscription is closed")
        return snapshot

    def next(self, *, timeout: float | None = None) -> Snapshot | None:
        """Waits until any of the values was read again, a poll failed, or the connection was lost; ``None`` once it or the robot
        is closed, by another thread, too. Who comes late gets the latest values. Errors: ``TimeoutError``."""
        return self._core.next(timeout).wait()

    def __iter__(self) -> Iterator[Snapshot]:
        """The values whenever there are new ones, until it or the robot is closed."""
        while (snapshot := self.next()) is not None:
            yield snapshot

    def close(self) -> None:
        """Ends it, and the waiting of others for its next values."""
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
    """What happens on a connection without being asked for: iterate over it."""

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
