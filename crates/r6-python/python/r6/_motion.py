"""What runs on a robot: a motion, its steps, and a target that is followed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

from ._errors import MotionError
from ._r6 import AxisPosition, Block, FollowCore, MotionCore, Progress
from ._types import Done, Followed, StepState, StopReport

Core = TypeVar("Core", MotionCore, FollowCore)


class Running(Block[Core]):
    """What a motion that runs and a target that is followed have in common: how they end."""

    def finished(self) -> Done | Followed:
        """Waits until the arm stands; each kind says more."""
        raise NotImplementedError

    def stop(self) -> StopReport:
        """Ends it and stops the arm, verified, its list cleared. Errors: as ``Robot.stop``."""
        return self._core.stop().wait()

    def release(self) -> None:
        """Lets go of it, as dropping it does. The class says what the arm does then."""
        self._core.release()


class MotionHandle(Running[MotionCore]):
    """A motion that runs.

    Dropping it, or ``release``, does not end the motion: it is streamed to its end, and ``Robot.wait_until_done`` waits for that and
    tells how it ended. With ``RunOptions.stop_on_drop`` the arm is stopped instead. Both need a process that lives on and a
    robot that is not closed: the end of the process and ``Robot.close`` end the streaming, and the arm finishes the
    instructions in its list.

    As a ``with`` block, it stops the arm when the block ends with an exception, Ctrl-C included: always, also after the
    end of the motion and after ``release``, because steps may be left in the list. What became of the arm is a line below the
    exception (Python 3.11). If that stop fails, its error is raised; a ``MotionError`` of this motion goes on instead and has it as
    ``stop``. Another Ctrl-C does not cut the stop short: the block ends when it has ended, after 15 s at most.

    Without an exception the block waits for the end of the motion. Ctrl-C in that wait stops the arm, too. A motion that ``stop`` of this
    handle ended, and whose arm was seen to stand, ends the block without an exception.
    """

    @property
    def number(self) -> int:
        """The number of the motion among those of its robot, counted from 1: ``Done.motion`` names it."""
        return self._core.number

    @property
    def progress(self) -> Progress:
        """How far it is now."""
        return self._core.progress()

    def __iter__(self) -> Iterator[Progress]:
        """Each progress, up to the one that has ended. Who is slow gets the latest."""
        while (progress := self._core.next_progress().wait()) is not None:
            yield progress

    def step(self, number: int) -> Step:
        """One step, counted from 1; ``IndexError`` if there is none such."""
        self._core.step_state(number)
        return Step(self._core, number)

    def ended_within(self, time: float) -> bool:
        """Waits for the end for so many seconds; whether it came. ``finished`` then tells it at once."""
        return self._core.ended_within(time).wait()

    def finished(self) -> Done:
        """Waits until the arm stands at the end of the motion, with nothing left in its list: judged by state.

        Ctrl-C ends the waiting, not the motion: call ``stop`` to stop the arm. Can be called again, and after ``release``.

        Errors: ``MotionError``: why it ended before, what became of the steps, and what became of the arm.
        """
        with of(self._core):
            return self._core.finished().wait()

    def __repr__(self) -> str:
        return f"<MotionHandle {self.progress!r}>"


class Following(Running[FollowCore]):
    """A target that is followed.

    Dropping it, ``release``, or the end of the process ends it: the arm finishes the step or two in its list. As a
    ``with`` block, it stops the arm when the block ends with an exception, Ctrl-C included, and waits until the arm stands
    otherwise; errors as in ``MotionHandle``.
    """

    def target(self, to: AxisPosition) -> None:
        """Where the target is now. Does not wait. Send it again while the arm is to go there: it counts for
        ``FollowOptions.fresh_within``.

        Errors: ``MotionError``: why the target is not followed any more; ``RuntimeError`` after ``finished``.
        """
        with of(self._core):
            self._core.target(to)

    def finished(self) -> Followed:
        """Takes no other target, and waits until the arm stands. Can be called again.

        No step is begun any more: for the arm to arrive, send the last target for as long as that takes. Errors:
        ``MotionError``; its steps are those that were sent.
        """
        with of(self._core):
            return self._core.finished().wait()


class Step:
    """One step of a motion that runs."""

    def __init__(self, core: MotionCore, number: int) -> None:
        """Use ``MotionHandle.step``."""
        self._core = core
        self.number = number

    @property
    def state(self) -> StepState:
        """What has become of it."""
        return self._core.step_state(self.number)

    def started(self) -> bool:
        """Waits until its turn has come; ``False`` if it never will, as far as is known."""
        return self._core.step_started(self.number).wait()

    def done(self) -> bool:
        """Waits until it is over; ``False`` if that was not seen."""
        return self._core.step_done(self.number).wait()

    def __repr__(self) -> str:
        return f"<Step {self.number}: {self.state}>"


@contextmanager
def of(core: MotionCore | FollowCore) -> Iterator[None]:
    """Marks a ``MotionError`` as one of this motion. It names the core, not the handle: a handle that is dropped is to go at once."""
    try:
        yield
    except MotionError as error:
        error._core = core
        raise
