"""Exceptions, sorted by what the caller must do next.

::

    R6Error
    ├── RequestError          a request failed
    │   ├── InvalidRequest    it cannot be sent as it is: the caller has to change it (also a ValueError)
    │   │   └── OutsideEnvelope   the guard refused it
    │   ├── NotSent           nothing reached the controller: sending again is safe
    │   ├── Refused           the controller understood and refused
    │   └── OutcomeUnknown    it left and no usable reply came: the controller may have acted
    ├── MotionError           a motion did not come to its end
    │   └── NotReady          the machine is not ready; nothing was sent
    ├── WaitError             a wait for the end of a motion failed
    ├── StepError             a step of a motion is wrong (also a ValueError)
    ├── NotTaken              a register has another value than the written one
    ├── NoReading             an address has no value (also a LookupError)
    ├── UnknownAddress        there is no such address (also a ValueError)
    ├── OutOfRange            a unit does not allow the number (also a ValueError)
    ├── NotSubscribed         there is no subscription (also a ValueError)
    ├── FileError             a file written by a person is wrong (also a ValueError)
    ├── SimulatorError        a virtual controller could not be started
    └── PanelRefused          the virtual machine refused an operator's action
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from ._r6 import Progress
    from ._types import Identity, Mistake, StopReport, Unmet


class R6Error(Exception):
    """The root of all errors of this package. The text says what was wrong, where, and what to do.

    It can be pickled and copied, with its attributes, its notes, and its ``__cause__`` if that is an error
    of this package.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        state = {name: value for name, value in self.__dict__.items() if name != "_core"}
        if isinstance(self.__cause__, R6Error):
            state["__cause__"] = self.__cause__
        return type(self), self.args, state


class RequestError(R6Error):
    """A request failed. Its class says what may be done next."""

    may_send_again: bool = False
    """Whether the same request may be sent again without further checks. Either nothing left and it may get
    through the next time, or it does no harm twice (a query, a stop). False for a motion with an unknown
    outcome, and for a request that cannot be sent as it is."""
    reason: str | None = None
    """A word for programs (``"unreachable"``, ``"timed_out"``, …); for ``Refused`` the controller's
    reason; over ``Gateway`` the code of its problem (``"leased"``, ``"stopped"``, …)."""


class InvalidRequest(RequestError, ValueError):
    """The request cannot be sent as it is: the caller has to change it. Nothing was sent, and the same
    request fails again.

    ``reason`` is one of ``bad_address``, ``value`` (the wire cannot carry it), ``too_long``,
    ``outside_envelope``.
    """

    nearest: tuple[float, float] | None = None
    """The values below and above it that can be sent, if it lies between two steps of the wire."""


class NotSent(RequestError):
    """Nothing reached the controller: sending again is safe.

    ``reason`` is one of ``unreachable``, ``connect_timed_out``, ``disconnected``, ``state_not_read``,
    ``another_robot``, ``unidentified``, ``overtaken`` (a stop came before the request left), ``withdrawn``,
    ``busy``, ``no_room``, ``closed``, ``no_engine``.
    """

    expected: Identity | None = None
    """The intended robot, if the reason is ``another_robot``."""
    found: Identity | None = None
    """The robot that answers there now. Pass it to ``accept_identity`` if it is the right one."""


class OutsideEnvelope(InvalidRequest):
    """A step exceeds the envelope of the guard. Nothing of its list was sent."""

    step: int = 0
    """The step, counted from 1."""
    what: str = ""
    """What exceeds the envelope: ``"speed"``, ``"J3"``, ``"J3 step"``, ``"J3 unit"``, ``"X"``,
    ``"distance"``, ``"frame"``, …"""
    value: float | None = None
    """Its value: %, mm/s, degrees or mm. ``None`` if it cannot be determined, which counts as a violation."""
    limit: tuple[float, float] = (0.0, 0.0)
    """The lowest and the highest allowed value, in the same unit."""


class Refused(RequestError):
    """The controller understood and refused. ``reason`` is the controller's reason, if it gives one."""


class OutcomeUnknown(RequestError):
    """The request left and no usable reply came back: the controller may have acted.

    A motion is never sent again then. ``reason`` is one of ``timed_out``, ``connection_lost``,
    ``unreadable``, ``unclear``, ``another_robot`` (another robot answered a query: its values are not
    returned).
    """

    request: str = ""
    """The word of the request on the wire: ``"AddRCC"``, ``"query"``, the command's word."""
    effect: Literal["reads", "changes", "moves", "stops"] = "reads"
    """What the request can do to the machine."""
    expected: Identity | None = None
    """The intended robot, if the reason is ``another_robot``."""
    found: Identity | None = None
    """The robot that answered. Pass it to ``accept_identity`` if it is the right one."""


class MotionError(R6Error):
    """A motion did not come to its end: why, what became of its steps, and what became of the arm.

    If a request, a step or the guard was the cause, that error is ``__cause__``.
    """

    cause: str = ""
    """One of these:

    - ``step``, ``outside_envelope``, ``not_ready``, ``not_cleared``, ``another_runs``
    - ``earlier_failed``: the motion before this one did not come to its end, and no caller has asked for
      its result. That error is ``__cause__``, and is reported once.
    - ``not_sent``, ``invalid``, ``refused``, ``outcome_unknown``, ``alarm_raised``, ``stopped``
    - ``restarted``: the controller was switched off and on.
    - ``stopped_here``, ``dropped``, ``closed``, ``released``, ``not_seen``, ``not_proved``,
      ``another_list``, ``elsewhere``, ``stalled``, ``unreadable``, ``abandoned``
    """
    progress: Progress
    """What became of its steps; ``progress.current`` is the step that was running."""
    stop: StopReport | RequestError | None = None
    """What became of the arm, if it was stopped. An error means that the stop failed: use the emergency
    stop."""
    nothing_left: bool = False
    """Whether no part of the motion was sent."""
    alarm: int | None = None
    """The alarm, if that is the cause."""
    mode: int | None = None
    """The mode of the controller, if the program no longer runs."""
    list_length: int | None = None
    """The length of the list, if the cause is ``another_list``."""
    _core: object = None
    """The motion of this error, for its ``with`` block. The block of another motion may pass the error on."""


class NotReady(MotionError):
    """The machine is not ready, and nothing was sent."""

    unmet: tuple[Unmet, ...] = ()
    """The unmet conditions, in the order in which to resolve them."""


class WaitError(R6Error):
    """The wait ended, but the motion did not end as it should."""

    cause: Literal[
        "alarm_raised", "stopped", "restarted", "timed_out", "request", "another_connection", "motion"
    ] = "request"
    """The cause:

    - ``motion``: a motion did not come to its end, and no caller has asked for its result. Its
      ``MotionError`` is ``__cause__``.
    - ``restarted``: the connection was lost, and the controller seems to have been switched off and on.
    - ``another_connection``: the instructions were accepted over a connection that is gone.
    - ``request``: a request failed; it is ``__cause__``.
    """
    alarm: int | None = None
    """The alarm, if that is the cause."""
    mode: int | None = None
    """The mode of the controller, if the program does not run."""
    list_length: int | None = None
    """Instructions left in the list at the timeout, if the controller reports them."""


class StepError(R6Error, ValueError):
    """A step of a motion is wrong. Nothing of the motion was sent, and nothing of it ever will be."""

    step: int = 0
    """The step, counted from 1; 0 for the whole motion."""
    field: str = ""
    """The field, by its name on the wire."""
    wanted: str = ""
    """What the value has to be."""
    nearest: tuple[float, float] | None = None
    """The values below and above it that can be sent, if it lies between two steps of the wire."""


class NotTaken(R6Error):
    """A register was written, the controller answered ok, and the register has another value."""

    register: int = 0
    """The register."""
    wrote: int = 0
    """The written value."""
    found: int | None = None
    """The value of the register; ``None`` if it cannot be read."""


class NoReading(R6Error, LookupError):
    """An address has no value: the controller does not support it, or it sent something that is no value."""


class UnknownAddress(R6Error, ValueError):
    """There is no address of this name; the text names the nearest."""


class OutOfRange(R6Error, ValueError):
    """A number that the unit does not allow."""

    value: float = 0.0
    """The number."""
    wanted: str = ""
    """What the number has to be."""
    nearest: tuple[float, float] | None = None
    """The numbers below and above it that the unit allows, if it lies between two steps."""


class NotSubscribed(R6Error, ValueError):
    """No address, too many, or a period below 20 ms or above one hour."""


class FileError(R6Error, ValueError):
    """A file written by a person is wrong. The text has a line for each mistake, ``FILE:LINE:COLUMN: what``,
    and the advice."""

    mistakes: tuple[Mistake, ...] = ()
    """The listed mistakes, in the order of their places: at most twenty."""
    more: int = 0
    """The number of mistakes that are not listed."""


class SimulatorError(R6Error):
    """A virtual controller could not be started; nothing is left running.

    If a profile, program or scenario is wrong, the text has a line for each mistake: ``FILE:LINE:COLUMN:
    what``.
    """

    mistakes: tuple[Mistake, ...] = ()
    """The listed mistakes of that file: at most twenty."""
    more: int = 0
    """The number of mistakes that are not listed."""


class PanelRefused(R6Error):
    """The virtual machine refused an operator's action; nothing has changed."""

    code: str = ""
    """A stable word for programs: ``"emergency_stop"``, ``"alarm"``, ``"not_auto"``, …"""


class MotionCutShort(RuntimeWarning):
    """``Robot.close`` ended a motion that was still being streamed. The text says which steps were not sent,
    and what the arm does.

    To make it an error: ``warnings.simplefilter("error", r6.MotionCutShort)``. The connection is closed
    before it is raised.
    """


# Makes tracebacks show the classes under the name that users import.
for _error in [value for value in list(globals().values()) if isinstance(value, type)]:
    _error.__module__ = "r6"
del _error
