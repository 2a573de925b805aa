"""A controller that misbehaves on purpose: the program ``r6-hostile`` of r6-testkit, in its own process."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Any

from typing_extensions import Self

WORKSPACE = Path(__file__).parents[3]
BUILT_WITHIN = 280
"""Seconds: below the limit of one test, because a test may have to build the program."""


def built() -> Path:
    """Builds the program and returns its path."""
    command = ["cargo", "build", "--quiet", "--package", "r6-testkit", "--bin", "r6-hostile"]
    subprocess.run(command, cwd=WORKSPACE, check=True, timeout=BUILT_WITHIN)
    target = Path(os.environ.get("CARGO_TARGET_DIR", "target"))
    return WORKSPACE / target / "debug" / "r6-hostile"


class Hostile:
    """A controller that misbehaves. Its character is ``r6_testkit::hostile::Character``."""

    def __init__(self, program: Path, character: dict[str, object]) -> None:
        pipe = subprocess.PIPE
        command = [str(program), json.dumps(character)]
        self._popen = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
        self.address = f"127.0.0.1:{self._told()['port']}"

    def ask(self, line: str) -> Any:
        """Sends it a line, and returns its answer."""
        assert self._popen.stdin is not None
        self._popen.stdin.write(f"{line}\n")
        self._popen.stdin.flush()
        return self._told()

    def _told(self) -> Any:
        assert self._popen.stdout is not None
        return json.loads(self._popen.stdout.readline())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        # It ends when its input ends.
        self._popen.communicate(timeout=60)
