"""A motion that runs on a robot, its steps, and a target that is followed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

from ._errors import MotionError
from ._r6 import AxisPosition, Block, FollowCore, MotionCore, Progress
from ._types import Done, Followed, StepState, StopReport

Core = TypeVar("Core", MotionCore, FollowCore)


class Running(Block[Core]):
    """The common part of a running motion and a followed target: how they end."""

    def finished(self) -> Done | Followed:
        """Waits until the arm stands; the subclasses say more."""
        raise NotImplementedError

    def stop(self) -> StopReport:
        """Ends it and stops the arm, verified, and clears its list. Errors: as ``Robot.stop``."""
        return self._core.stop().wait()

    def release(self) -> None:
        """Releases it, as dropping it does. The class says what the arm does then."""
        self._core.release()


class MotionHandle(Running[MotionCore]):
    """A running motion.

    Dropping it, or ``release``, does not end the motion: it is streamed to its end.
    ``Robot.wait_until_done`` waits for that and reports how it ended. With ``RunOptions.stop_on_drop`` the
    arm is stopped instead. Both need a running process and an open robot: the end of the process and
    ``Robot.close`` end the streaming, and the arm finishes the instructions in its list.

    As a ``with`` block, it stops the arm when the block ends with an exception, Ctrl-C included. It always
    does so, also after the end of the motion and after ``release``, because steps may be left in the list.
    The exception gets a note with the result (Python 3.11). If that stop fails, its error is raised. A
    ``MotionError`` of this motion is raised instead and has it as ``stop``. Another Ctrl-C does not
    interrupt the stop: the block ends when the stop has ended, after at most 15 s.

    Without an exception the block waits for the end of the motion. Ctrl-C in that wait stops the arm, too.
    If ``stop`` of this handle ended the motion and the arm was seen to stand, the block ends without an
    exception.
    """

    @property
    def number(self) -> int:
        """The number of the motion among those of its robot, counted from 1: ``Done.motion`` refers to it."""
        return self._core.number

    @property
    def progress(self) -> Progress:
        """The present progress."""
        return self._core.progress()

    def __iter__(self) -> Iterator[Progress]:
        """Each progress until the end of the motion. A slow reader gets only the latest."""
        while (progress := self._core.next_progress().wait()) is not None:
            yield progress

    def step(self, number: int) -> Step:
        """One step, counted from 1; ``IndexError`` if there is no such step."""
        self._core.step_state(number)
        return Step(self._core, number)

    def ended_within(self, time: float) -> bool:
        """Waits for the end at most ``time`` seconds, and returns whether it came. ``finished`` then returns
        at once."""
        return self._core.ended_within(time).wait()

    def finished(self) -> Done:
        """Waits until the arm stands at the end of the motion, with nothing left in its list: judged by
        state.

        Ctrl-C ends the wait, not the motion: call ``stop`` to stop the arm. Can be called again, and after
        ``release``.

        Errors: ``MotionError``: why it ended early, what became of the steps, and what became of the arm.
        """
        with of(self._core):
            return self._core.finished().wait()

    def __repr__(self) -> str:
        return f"<MotionHandle {self.progress!r}>"


class Following(Running[FollowCore]):
    """A followed target.

    Dropping it, ``release``, or the end of the process ends it: the arm finishes the step or two in its
    list. As a ``with`` block, it stops the arm when the block ends with an exception, Ctrl-C included.
    Otherwise it waits until the arm stands. Errors as in ``MotionHandle``.
    """

    def target(self, to: AxisPosition) -> None:
        """Sets the present target. Does not wait. It counts for ``FollowOptions.fresh_within``, so send it
        repeatedly as long as the arm is to go there.

        Errors: ``MotionError``: why the target is no longer followed; ``RuntimeError`` after ``finished``.
        """
        with of(self._core):
            self._core.target(to)

    def finished(self) -> Followed:
        """Accepts no other target, and waits until the arm stands. Can be called again.

        No new step begins. For the arm to arrive, send the last target until it is there. Errors:
        ``MotionError``; its steps are those that were sent.
        """
        with of(self._core):
            return self._core.finished().wait()


class Step:
    """One step of a running motion."""

    def __init__(self, core: MotionCore, number: int) -> None:
        """Use ``MotionHandle.step``."""
        self._core = core
        self.number = number

    @property
    def state(self) -> StepState:
        """The state of the step."""
        return self._core.step_state(self.number)

    def started(self) -> bool:
        """Waits until the step begins; ``False`` if it never will, as far as is known."""
        return self._core.step_started(self.number).wait()

    def done(self) -> bool:
        """Waits until the step is over; ``False`` if that was not seen."""
        return self._core.step_done(self.number).wait()

    def __repr__(self) -> str:
        return f"<Step {self.number}: {self.state}>"


@contextmanager
def of(core: MotionCore | FollowCore) -> Iterator[None]:
    """Marks a ``MotionError`` as one of this motion. It refers to the core, not the handle, so that a dropped
    handle is freed at once."""
    try:
        yield
    except MotionError as error:
        error._core = core
        raise
