"""The Python code in the pages: each block compiles, has the right types, and does what the page says."""

import ast
import inspect
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent

import pytest

import r6

ROOT = Path(__file__).parents[3]
FENCE = re.compile(r"^([ \t]*)```python[^\n]*\n(.*?)^\1```[ \t]*$", re.MULTILINE | re.DOTALL)

SCRIPT = "docs/FROM_SOCKETS.md 1"
"""The script that a page is about. It does not use this package, and has no types."""


@dataclass
class Block:
    """A block of a page."""

    page: str
    number: int
    code: str

    @property
    def name(self) -> str:
        return f"{self.page} {self.number}"

    @property
    def file(self) -> str:
        return re.sub(r"\W+", "_", self.name).lower() + ".py"


def pages() -> Iterator[Path]:
    for pattern in ("*.md", "docs/**/*.md", "crates/*/*.md", "examples/**/*.md", "vectors/**/*.md"):
        yield from sorted(ROOT.glob(pattern))


def blocks() -> Iterator[Block]:
    for page in pages():
        for number, match in enumerate(FENCE.finditer(page.read_text(encoding="utf-8")), 1):
            yield Block(page.relative_to(ROOT).as_posix(), number, dedent(match[2]))


def english(page: str) -> str:
    """The page that this page says in Chinese; the page itself if it is in English."""
    return page.replace("docs/zh/", "docs/").replace(".zh.md", ".md")


BLOCKS = {block.name: block for block in blocks() if english(block.page) == block.page}

CHINESE = [block for block in blocks() if english(block.page) != block.page]
"""Blocks of the Chinese pages. They do not run: they are the blocks of the English pages, with comments in
Chinese."""


def ten_lines(said: str, controller: r6.Simulator) -> None:
    assert said == "J1 10.0 J5 30.0\n"
    assert controller.snapshot().axes.round(3).tolist() == [10, 0, 0, 0, 30, 0]


def script(said: str, controller: r6.Simulator) -> None:
    """Checks what the page says: the script prints the mode as the name of the program, and does not write a
    register."""
    assert said == f"{{'version': '{controller.snapshot().firmware}', 'curMold': '7'}}\n"
    log = [line.event for line in controller.log()]
    assert any(event["event"] == "command_without_effect" for event in log), log[-20:]
    with r6.Robot.connect(controller.address) as robot:
        assert robot.read_registers(800).tolist() == [0]


def replacement(said: str, controller: r6.Simulator) -> None:
    assert said.startswith(f"{controller.snapshot().firmware} None 7\nat [") and "not ready" not in said
    with r6.Robot.connect(controller.address) as robot:
        assert robot.read_registers(800).tolist() == [12500]


def package(said: str, controller: r6.Simulator) -> None:
    assert said.split() == "[10. 0. 0. 0. 30. 0.]".split()


def watch(said: str, controller: r6.Simulator) -> None:
    assert re.search(r"^\[0\. 7\.\] \[\d\.[\de-]+ \d\.[\de-]+\]$", said, re.MULTILINE)


def stopped(said: str, controller: r6.Simulator) -> None:
    assert "the arm stands" in said and said.endswith("not ready: []\n"), said
    assert controller.snapshot().axes[0] < 90


def passed(said: str, controller: r6.Simulator) -> None:
    assert "2 passed" in said


def ran(said: str, controller: r6.Simulator) -> None:
    assert "1 passed" in said


DID: dict[str, Callable[[str, r6.Simulator], None]] = {
    "README.md 1": ten_lines,
    "docs/FROM_SOCKETS.md 1": script,
    "docs/FROM_SOCKETS.md 2": replacement,
    "docs/QUICKSTART.md 1": ten_lines,
    "docs/QUICKSTART.md 2": ran,
    "docs/QUICKSTART.md 3": stopped,
    "docs/QUICKSTART.md 4": ran,
    "crates/r6-python/README.md 1": package,
    "crates/r6-python/README.md 2": watch,
    "crates/r6-python/README.md 3": passed,
}
"""Checks the output of each block, and the state of its controller."""


def test_every_block_is_here() -> None:
    assert set(BLOCKS) == set(DID)
    for page in pages():
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"```(py|python3|pycon)\b", text), f"{page}: write ```python"


def without_comments(code: str) -> str:
    """The code of a block without its comments and docstrings."""
    module = ast.parse(code)
    for node in ast.walk(module):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and ast.get_docstring(node):
            del node.body[0]
    return ast.unparse(module)


def test_the_blocks_of_the_chinese_pages_are_those_of_the_english_ones() -> None:
    assert CHINESE
    for page in (page.relative_to(ROOT).as_posix() for page in pages()):
        if english(page) != page:
            code = [without_comments(block.code) for block in CHINESE if block.page == page]
            twins = [block.code for block in BLOCKS.values() if block.page == english(page)]
            assert code == [without_comments(block) for block in twins], page


def test_the_ten_lines_are_the_same_everywhere() -> None:
    assert BLOCKS["README.md 1"].code == BLOCKS["docs/QUICKSTART.md 1"].code


def mypy(folder: Path, *arguments: str) -> str:
    command = [sys.executable, "-m", "mypy", "--cache-dir", str(folder / "cache"), *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=600)
    return "" if ended.returncode == 0 else ended.stdout + ended.stderr


def test_the_blocks_are_strictly_typed(tmp_path: Path) -> None:
    for block in BLOCKS.values():
        (tmp_path / block.file).write_text(block.code)
    typed = [block.file for name, block in BLOCKS.items() if name != SCRIPT]
    assert mypy(tmp_path, "--strict", *typed) == ""
    assert mypy(tmp_path, BLOCKS[SCRIPT].file) == ""


def program(block: Block, controller: r6.Simulator) -> str:
    """The block as a program, which calls the functions that take an address with the address of the
    controller."""
    if block.name == SCRIPT:
        assert '"127.0.0.1", 9760' in block.code
        return block.code.replace("9760", str(controller.port))
    calls = []
    for item in ast.parse(block.code).body:
        if isinstance(item, (ast.FunctionDef, ast.AsyncFunctionDef)):
            assert [argument.arg for argument in item.args.args] == ["address"], item.name
            call = f"{item.name}({controller.address!r})"
            calls.append(f"asyncio.run({call})" if isinstance(item, ast.AsyncFunctionDef) else call)
    return "\n".join([block.code, "import asyncio", *calls, ""])


@pytest.mark.virtual_controller(clock=10)
@pytest.mark.parametrize("name", DID)
def test_it_does_what_the_page_says(name: str, virtual_controller: r6.Simulator, tmp_path: Path) -> None:
    block = BLOCKS[name]
    path = tmp_path / f"test_{block.file}"
    tests = "def test_" in block.code
    # The page shows this program, and tells the reader to save it.
    shutil.copy(ROOT / "examples/taught/camera-pick.toml", tmp_path)
    path.write_text(block.code if tests else program(block, virtual_controller))
    command = [sys.executable, *(["-m", "pytest", "-q", "-p", "no:cacheprovider"] if tests else []), str(path)]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=120)
    assert (ended.returncode, ended.stderr) == (0, ""), ended.stdout + ended.stderr
    DID[name](ended.stdout, virtual_controller)


def stub_docs() -> Iterator[tuple[str, str, str | None]]:
    """Class or "", method or function, and what the stub says of it, for all that ``r6`` exports."""
    stub = ast.parse((Path(r6.__file__).parent / "_r6.pyi").read_text())
    for node in stub.body:
        if isinstance(node, ast.FunctionDef) and node.name in r6.__all__:
            yield "", node.name, ast.get_docstring(node)
        if isinstance(node, ast.ClassDef) and node.name in r6.__all__:
            yield "", node.name, ast.get_docstring(node)
            methods = [item for item in node.body if isinstance(item, ast.FunctionDef)]
            for method in methods:
                if not method.name.startswith("_"):
                    yield node.name, method.name, ast.get_docstring(method)


def test_help_tells_what_the_stub_tells() -> None:
    told = list(stub_docs())
    assert len(told) > 120
    for kind, name, text in told:
        owner = getattr(r6, kind) if kind else r6
        assert text and inspect.getdoc(getattr(owner, name)) == text, f"{kind}.{name}"


def test_every_method_has_help() -> None:
    for name in r6.__all__:
        thing = getattr(r6, name)
        if not inspect.isclass(thing):
            continue
        own = {
            method: value
            for kind in thing.__mro__
            if kind.__module__.startswith("r6")
            for method, value in vars(kind).items()
            if not method.startswith("_") and (callable(value) or isinstance(value, (property, classmethod)))
        }
        without = [method for method in own if not inspect.getdoc(getattr(thing, method))]
        assert inspect.getdoc(thing) and not without, f"{name}: {without}"
