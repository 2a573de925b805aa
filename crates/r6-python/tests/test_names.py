"""Python has everything of the Rust client under the same name, or the table here says where, or why not.

The names are read from the sources of the client, so that the test notices a new one.
"""

import inspect
import re
from pathlib import Path
from typing import Any

import pytest

import r6

CLIENT = Path(__file__).parents[2] / "r6-client" / "src"
COMMAND = Path(__file__).parents[2] / "r6-proto" / "src" / "message" / "command" / "table.rs"

# Names of the crate. A value that begins with a blank is a reason; any other is a name of the package.
ELSEWHERE = {
    "Address": "addresses",
    "AxisCoordinate": " Degrees or Millimetres",
    "AxisIndex": " a number from 0",
    "BlendLevel": " a number from 0 to 9",
    "BoardOutput": "Motion.set_board",
    "CameraSet": "Robot.add_points",
    "Cause": "MotionError.cause",
    "Changes": " how the gateway waits for many subscriptions at once",
    "Checked": "OutsideEnvelope.what",
    "Closed": "MotionCutShort",
    "Conditions": " the gateway sends under them",
    "Connect": " bytes over something else than TCP",
    "DEFAULT_PORT": "Robot.connect",
    "DoubtAfterStop": "StopReport.in_doubt",
    "Effect": "OutcomeUnknown.effect",
    "EndProof": "Done.proof",
    "Found": "Reconnected",
    "Heartbeat": "RobotSettings",
    "Instruction": "Motion",
    "IoPoint": " the name of a point on the pendant, such as Y010",
    "Invalid": "InvalidRequest",
    "Keep": "Robot.write_registers",
    "LinkState": "LinkQuality",
    "ListAfterStop": "StopReport",
    "ListGate": " the gateway asks for a permit with it",
    "Liveness": "RobotSettings",
    "LostReason": "ConnectionLost",
    "MAX_STEPS": "Motion",
    "Missed": "MotionError",
    "NotProved": "MotionError.cause",
    "NotTried": "StopReport",
    "OutputBoard": "Motion.set_board",
    "OutputKind": "Motion.set_output",
    "StopsUnderWay": " Robot.close and the end of the program wait for them",
    "PairMask": "Motion.set_board",
    "Permission": " the gateway withdraws what has not left",
    "PointKind": " the letters of a point's name",
    "PhotoAnswer": "Robot.answer_photo",
    "Pushed": "Event",
    "Readiness": "Status.unproved",
    "Reconnect": "RobotSettings",
    "RegisterError": "NotTaken",
    "Restart": "MotionError.cause",
    "Recorded": " only the gateway keeps every poll",
    "Recording": " only the gateway keeps every poll",
    "RawReply": " only the gateway hands values on as they were written",
    "RawValue": " only the gateway hands values on as they were written",
    "RegisterIndex": " a number from 800 to 900",
    "SecondConnection": "StopReport.second_connection",
    "Sent": "OutcomeUnknown.request",
    "StandProof": "StopReport.proof",
    "StepHandle": "Step",
    "StopMeans": "StopReport.means",
    "TargetSender": "Following.target",
    "Targets": "Robot.follow",
    "Unproved": "Status.unproved",
    "Violation": "OutsideEnvelope",
    "WaitCondition": "Motion.wait_for",
    "WaitOptions": "Robot.wait_until_done",
    "WaitSource": "Motion.wait_for",
    "WrongPoint": " ValueError",
    "address_with_port": " Robot.connect adds the port",
    "check_address": " Robot.connect checks it",
    "callback": " AsyncRobot runs on the event loop of asyncio",
}

# Methods and fields by class: the file, the class in Rust and in Python, and names that are elsewhere.
Table = dict[str, str]
METHODS: list[tuple[str, str, type[Any], Table]] = [
    (
        "blocking.rs",
        "Robot",
        r6.Robot,
        {
            "block_on": " futures of Rust",
            "query_again": " a result of Python is made anew",
            "connect_on": "connect",
            "connect_with": "connect",
            "engine": " one for the process",
            "events": " lost connections and other robots come with pushed, motions that fail with MotionError",
            "as_async": " AsyncRobot.connect",
            "add_motion": "add_rcc",
            "learned": " what the wire looks like",
            "query_again": " values are made anew in Python, whatever asks for them",
        },
    ),
    ("blocking/cell.rs", "Robot", r6.Robot, {}),
    (
        "blocking/motion.rs",
        "MotionHandle",
        r6.MotionHandle,
        {"steps": " the motion that was run", "wait": "finished", "watch": "__iter__"},
    ),
    ("blocking/motion.rs", "StepHandle", r6.Step, {"number": "__init__"}),
    (
        "moves.rs",
        "Motion",
        r6.Motion,
        {
            "new": "__new__",
            "len": "__len__",
            "part": "__getitem__",
            "is_empty": "__len__",
            "begin_frame": " frames are cut by their length",
            "instruction": " a step that Python has no name for",
            "of_list": " a step that Python has no name for",
            "instructions": " StepError comes at once",
        },
    ),
    ("guard.rs", "Envelope", r6.Envelope, {"new": "__new__", "and": "__and__"}),
    ("units.rs", "Percent", r6.Percent, {"new": "__new__"}),
    ("units.rs", "MillimetresPerSecond", r6.MillimetresPerSecond, {"new": "__new__"}),
    ("units/position.rs", "AxisPosition", r6.AxisPosition, {"none": "__new__", "with": "with_axis"}),
    ("units/position.rs", "Pose", r6.Pose, {"new": "__new__"}),
    ("units/nearest.rs", "Degrees", r6.Degrees, {}),
    ("units/nearest.rs", "Pose", r6.Pose, {}),
    ("progress.rs", "Progress", r6.Progress, {}),
    ("hands/listen.rs", "Listen", r6.Listen, {"on": "__new__", "only_from": "__new__"}),
]

FIELDS: list[tuple[str, str, Any, Table]] = [
    (
        "settings.rs",
        "RobotSettings",
        r6.RobotSettings,
        {"reconnect": "reconnect_cap", "liveness": "dead_after", "permission": " the gateway sends under it"},
    ),
    (
        "settings.rs",
        "Reconnect",
        r6.RobotSettings,
        {"first_wait": "reconnect_first_wait", "cap": "reconnect_cap", "jitter_seed": "reconnect_seed"},
    ),
    ("settings.rs", "Liveness", r6.RobotSettings, {}),
    ("stream/options.rs", "RunOptions", r6.RunOptions, {}),
    ("follow.rs", "FollowOptions", r6.FollowOptions, {}),
    ("done.rs", "WaitOptions", r6.Robot.wait_until_done, {}),
    ("status.rs", "Status", r6.Status, {}),
    (
        "stop/report.rs",
        "StopReport",
        r6.StopReport,
        {
            "robot": " Robot.identity",
            "connection": " a number of the client",
            "second": "second_connection",
            "doubt": "in_doubt",
        },
    ),
    ("link_quality.rs", "LinkQuality", r6.LinkQuality, {}),
    ("link_quality.rs", "Latency", r6.Latency, {}),
    ("identity.rs", "Identity", r6.Identity, {}),
    ("identity.rs", "Found", r6.Reconnected, {}),
    ("done.rs", "Done", r6.Done, {}),
    ("follow.rs", "Followed", r6.Followed, {}),
    ("job.rs", "Accepted", r6.Accepted, {}),
    ("hands/discover.rs", "Discovered", r6.Discovered, {}),
]


def source(file: str) -> str:
    return (CLIENT / file).read_text().split("#[cfg(test)]")[0]


def block(text: str, head: str) -> str:
    """All blocks of the source that begin with this line, without blocks inside of other types."""
    found = re.findall(rf"^{head} \{{\n(.*?)^\}}", text, re.MULTILINE | re.DOTALL)
    assert found, f"there is no `{head}`"
    return "\n".join(found)


def exported() -> set[str]:
    names = set()
    for used in re.findall(r"^pub use ([^;]+);", source("lib.rs"), re.MULTILINE):
        *_, last = re.sub(r"\s", "", used).split("::{" if "{" in used else "::")
        names |= set(last.rstrip("}").strip(",").split(","))
    units = source("units.rs") + source("units/position.rs")
    return names | set(re.findall(r"^pub (?:struct|enum) (\w+)", units, re.MULTILINE))


def resolve(name: str) -> object:
    found: Any = r6
    for part in name.split("."):
        found = found.__annotations__[part] if part in getattr(found, "__annotations__", {}) else getattr(found, part)
    return found


def test_every_name_of_the_client_is_here() -> None:
    names = exported()
    assert len(names) > 80 and {"Robot", "discover", "Listen", "Degrees"} <= names
    assert set(ELSEWHERE) <= names, f"the client has these no more: {set(ELSEWHERE) - names}"
    for name in sorted(names):
        there = ELSEWHERE.get(name, name)
        if not there.startswith(" "):
            resolve(there)
    assert all(hasattr(r6, name) for name in r6.__all__) and r6.__all__ == sorted(r6.__all__)


@pytest.mark.parametrize(("file", "rust", "python", "elsewhere"), METHODS, ids=lambda given: str(given)[:30])
def test_every_method_is_here(file: str, rust: str, python: type, elsewhere: Table) -> None:
    methods = re.findall(r"^    pub (?:const )?(?:async )?fn (\w+)", block(source(file), f"impl {rust}"), re.MULTILINE)
    assert methods and set(elsewhere) <= set(methods), set(elsewhere) - set(methods)
    missing = [elsewhere.get(name, name) for name in methods]
    assert [name for name in missing if not name.startswith(" ") and not hasattr(python, name)] == []


@pytest.mark.parametrize(("file", "rust", "python", "elsewhere"), FIELDS, ids=lambda given: str(given)[:30])
def test_every_field_is_here(file: str, rust: str, python: Any, elsewhere: Table) -> None:
    fields = re.findall(r"^    pub (\w+):", block(source(file), f"pub struct {rust}"), re.MULTILINE)
    assert fields and set(elsewhere) <= set(fields), set(elsewhere) - set(fields)
    known = set(inspect.signature(python).parameters)
    there = [elsewhere.get(name, name) for name in fields]
    assert [name for name in there if not name.startswith(" ") and name not in known] == []


def test_every_method_of_a_command_has_its_row() -> None:
    variants = re.findall(r'^    ([A-Z]\w+) (?:"|of )', COMMAND.read_text(), re.MULTILINE)
    names = {re.sub(r"(?<!^)(?=[A-Z])", "_", variant).lower() for variant in variants}
    names = (names - {"modify_stack_data"}) | {"modify_stack"}
    public = {name for name in vars(r6.Command) if not name.startswith("_")}
    # `typed` sends a command without its own method by its word.
    methods = public - {"word", "meaning", "typed"}
    without_method: set[str] = set()
    assert methods | without_method == names and len(methods) == 20
