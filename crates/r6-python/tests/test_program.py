"""Files of ``r6 run``, read in Python."""

import pickle
from pathlib import Path

import pytest
import r6

EXAMPLES = Path(__file__).parents[3] / "examples" / "programs"


def test_a_program_runs(virtual_controller: r6.Simulator) -> None:
    program = r6.Program.load(EXAMPLES / "square.toml")
    with r6.Robot.connect(virtual_controller.address) as robot:
        done = robot.run(program.motion, r6.RunOptions(append=program.append)).finished()
    assert len(program) == len(program.motion) > 0 and not program.append and program.remarks == []
    assert done is not None


def test_every_example_is_read() -> None:
    files = sorted(file for file in EXAMPLES.iterdir() if file.suffix in {".toml", ".json"})
    assert len(files) > 2
    for file in files:
        assert len(r6.Program.load(file)) > 0, file


def test_a_file_with_five_mistakes_gets_five(tmp_path: Path) -> None:
    file = tmp_path / "five.toml"
    file.write_text(
        'repeet = true\n[[instruction]]\ndo = "axis-move"\nto = [1, 2]\nsped = 5\nblend = 12\n'
        '[[instruction]]\ndo = "linear-move"\nspeed = "fast"\n'
    )
    with pytest.raises(r6.FileError) as caught:
        r6.Program.load(str(file))
    places = [(mistake.line, mistake.column) for mistake in caught.value.mistakes]
    assert places == [(1, 1), (5, 1), (6, 9), (7, 1), (9, 9)]
    lines = str(caught.value).splitlines()
    assert lines[0] == f"{file}:1:1: there is no key `repeet`" and lines[1] == "    nearest: `repeat`"
    again = pickle.loads(pickle.dumps(caught.value))
    assert again.mistakes == caught.value.mistakes and str(again) == str(caught.value)


def test_a_text_is_read_in_either_form() -> None:
    step = '{"oneshot":"1","action":"4","m0":"10.0","ckStatus":"0x01","speed":"20"}'
    frame = f'{{"dsID":"HCRemoteCommand","reqType":"AddRCC","emptyList":"0","instructions":[{step}]}}'
    program = r6.Program.read(f"// one step\n{frame}")
    assert program.append and len(program) == 1 and repr(program) == "<Program of 1 step>"
    old = r6.Program.read('[[instruction]]\ndo = "output"\nkind = "m"\npoint = 1\non = true\n')
    assert len(old.remarks) == 1 and 'point = "M011"' in old.remarks[0]
    repeating = r6.Program.read('repeat = true\n[[instruction]]\ndo = "wait"\nseconds = 1\n')
    assert repeating.motion.repeats
    with pytest.raises(r6.FileError, match=r"<text>:1:1: there is no frame|<text>: there is no"):
        r6.Program.read("// nothing")
    with pytest.raises(TypeError, match="cannot be pickled"):
        pickle.dumps(program)


def test_its_motion_is_a_copy() -> None:
    program = r6.Program.read('[[instruction]]\ndo = "wait"\nseconds = 1\n')
    program.motion.wait(1.0)
    assert len(program.motion) == 1


def test_what_cannot_be_read_says_so(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        r6.Program.load(tmp_path / "none.toml")
    long = tmp_path / "long.toml"
    with long.open("wb") as file:
        file.truncate(16 * 1024 * 1024 + 1)
    with pytest.raises(ValueError, match="too long"):
        r6.Program.load(long)
