"""A motion that runs on a robot, for asyncio: the same names as in ``_motion``, which documents them."""

from __future__ import annotations

from collections.abc import AsyncIterator, Coroutine
from types import TracebackType
from typing import TYPE_CHECKING, Any, Generic

from ._asyncio import run, run_at_once, stop_for
from ._errors import R6Error
from ._motion import Core, of
from ._r6 import AxisPosition, FollowCore, MotionCore, Progress, ended_as_asked
from ._types import Done, Followed, StepState, StopReport

if TYPE_CHECKING:
    from typing_extensions import Self


class AsyncRunning(Generic[Core]):
    """The end of a motion or a followed target: ``Running`` for asyncio."""

    def __init__(self, core: Core) -> None:
        """Use ``AsyncRobot.run`` or ``AsyncRobot.follow``."""
        self._core: Core = core

    async def finished(self) -> Done | Followed:
        """Waits until the arm stands; the subclasses say more."""
        raise NotImplementedError

    def stop(self) -> Coroutine[Any, Any, StopReport]:
        """As ``stop`` without asyncio. The call itself begins it, as for ``AsyncRobot.stop``."""
        return run_at_once(self._core.stop())

    def release(self) -> None:
        """As ``release`` without asyncio."""
        self._core.release()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is not None:
            await stop_for(self._core, error)
            return
        try:
            await self.finished()
        except R6Error as failed:
            if not ended_as_asked(self._core, failed):
                raise
        except BaseException as interrupt:
            await stop_for(self._core, interrupt)
            raise


class AsyncMotionHandle(AsyncRunning[MotionCore]):
    """A running motion: ``MotionHandle`` for asyncio.

    As an ``async with`` block, it stops the arm when the block ends with an exception, cancellation
    included, as ``MotionHandle`` does. Otherwise it waits for the end of the motion. A cancellation in
    that wait stops the arm, too. Another cancellation during the stop waits for the stop, at most 15 s.

    After a cancellation the logger ``r6`` also gets the result as a warning. A ``TaskGroup`` drops the
    exception that has the note, and ``asyncio.run`` raises another one for Ctrl-C.
    """

    @property
    def number(self) -> int:
        """As ``MotionHandle.number``."""
        return self._core.number

    @property
    def progress(self) -> Progress:
        """The present progress."""
        return self._core.progress()

    async def __aiter__(self) -> AsyncIterator[Progress]:
        """As iterating over ``MotionHandle``."""
        while (progress := await run(self._core.next_progress())) is not None:
            yield progress

    def step(self, number: int) -> AsyncStep:
        """As ``MotionHandle.step``."""
        self._core.step_state(number)
        return AsyncStep(self._core, number)

    async def ended_within(self, time: float) -> bool:
        """As ``MotionHandle.ended_within``."""
        return await run(self._core.ended_within(time))

    async def finished(self) -> Done:
        """As ``MotionHandle.finished``. Cancelling it ends the wait, not the motion."""
        with of(self._core):
            return await run(self._core.finished())

    def __repr__(self) -> str:
        return f"<AsyncMotionHandle {self.progress!r}>"


class AsyncFollowing(AsyncRunning[FollowCore]):
    """A followed target: ``Following`` for asyncio; use ``async with``."""

    def target(self, to: AxisPosition) -> None:
        """As ``Following.target``."""
        with of(self._core):
            self._core.target(to)

    async def finished(self) -> Followed:
        """As ``Following.finished``."""
        with of(self._core):
            return await run(self._core.finished())


class AsyncStep:
    """One step of a running motion: ``Step`` for asyncio."""

    def __init__(self, core: MotionCore, number: int) -> None:
        """Use ``AsyncMotionHandle.step``."""
        self._core = core
        self.number = number

    @property
    def state(self) -> StepState:
        """The state of the step."""
        return self._core.step_state(self.number)

    async def started(self) -> bool:
        """As ``Step.started``."""
        return await run(self._core.step_started(self.number))

    async def done(self) -> bool:
        """As ``Step.done``."""
        return await run(self._core.step_done(self.number))

    def __repr__(self) -> str:
        return f"<AsyncStep {self.number}: {self.state}>"
