"""A gateway of this repository, in its own process."""

from __future__ import annotations

import os
import re
import socket
import subprocess
from pathlib import Path

import r6

WORKSPACE = Path(__file__).parents[3]


def r6_program() -> Path:
    """The command `r6`: ``R6_PROGRAM``, or what `tools/python/run` or the Rust tests have built."""
    built = WORKSPACE / Path(os.environ.get("CARGO_TARGET_DIR", "target")) / "debug" / "r6"
    path = Path(os.environ.get("R6_PROGRAM", built))
    assert path.exists(), f"{path} is missing: `cargo build --package r6` builds it"
    return path


class Hall:
    """A gateway with one virtual robot, ``arm``."""

    def __init__(self, program: Path, folder: Path, controller: r6.Simulator, *options: str) -> None:
        self._program, self._folder = program, folder
        command = [str(program), "gateway", "--listen", "127.0.0.1:0", "--data", str(folder)]
        command += ["--robot", f"arm={controller.address}", *options]
        self._popen = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        assert self._popen.stdout is not None
        first = self._popen.stdout.readline()
        found = re.search(r"https?://[\d.]+:\d+", first)
        assert found is not None, first
        self.url = found[0]

    def token(self, *arguments: str) -> str:
        command = [str(self._program), "gateway", "token", "--data", str(self._folder), *arguments]
        made = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60)
        return made.stdout.strip()

    def close(self) -> None:
        self._popen.terminate()
        self._popen.wait(60)
        assert self._popen.stdout is not None
        self._popen.stdout.close()


def whole_request(stream: socket.socket) -> bytes:
    """A request with its body: a connection that is closed before all is read can lose the answer."""
    request = stream.recv(65536)
    head, _, body = request.partition(b"\r\n\r\n")
    lengths = [int(line[15:]) for line in head.split(b"\r\n") if line.lower().startswith(b"content-length:")]
    while len(body) < sum(lengths) and (more := stream.recv(65536)):
        body += more
    return head + b"\r\n\r\n" + body
