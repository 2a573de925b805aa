"""The golden transcripts of the repository, read by Python: each captured frame decodes to the recorded
values."""

import json
import socket
import threading
from pathlib import Path

import pytest

import r6

TRANSCRIPTS = sorted((Path(__file__).parents[3] / "vectors" / "transcripts").glob("*.jsonl"))


def lines(transcript: Path, sender: str) -> list[bytes]:
    """The frames of one sender."""
    entries = [json.loads(line) for line in transcript.read_text().splitlines()]
    return [entry["bytes"].encode() for entry in entries if entry.get("from") == sender and "bytes" in entry]


def complete_replies() -> list[dict[str, list[str]]]:
    """The query replies that have a value for each address."""
    frames = [json.loads(frame) for path in TRANSCRIPTS for frame in lines(path, "controller")]
    replies = [frame for frame in frames if "queryData" in frame]
    return [frame for frame in replies if len(frame["queryData"]) == len(frame["queryAddr"])]


def test_there_are_transcripts() -> None:
    assert len(TRANSCRIPTS) >= 3 and len(complete_replies()) >= 2


@pytest.mark.parametrize("captured", complete_replies(), ids=lambda frame: frame["queryAddr"][0])
def test_captured_values_are_read_as_they_are(captured: dict[str, list[str]]) -> None:
    server = socket.create_server(("127.0.0.1", 0))

    def answer() -> None:
        connection, _ = server.accept()
        with connection:
            while received := connection.recv(4096):
                request = json.loads(received)
                values = captured["queryData"]
                if request["queryAddr"] != captured["queryAddr"]:
                    # The client first asks for the identity.
                    values = ["6"] * len(request["queryAddr"])
                same = {"packID": request["packID"], "queryAddr": request["queryAddr"], "queryData": values}
                connection.sendall(json.dumps({**captured, **same}).encode())

    thread = threading.Thread(target=answer)
    thread.start()
    with server, r6.Robot.connect(f"127.0.0.1:{server.getsockname()[1]}") as robot:
        result = robot.query(*captured["queryAddr"])
    thread.join()
    assert result.missing == {}
    for address, value in zip(captured["queryAddr"], captured["queryData"], strict=True):
        read = result[address]
        if isinstance(read, (int, float)):
            assert read == float(value), address
        elif isinstance(read, str):
            assert read == value


@pytest.mark.parametrize("transcript", TRANSCRIPTS, ids=lambda path: path.stem)
def test_captured_queries_are_answered_at_the_raw_port(
    transcript: Path, virtual_controller: r6.Simulator
) -> None:
    with socket.create_connection(("127.0.0.1", virtual_controller.port), timeout=10) as raw:
        for frame in lines(transcript, "pc"):
            request = json.loads(frame)
            if request.get("reqType") != "query":
                continue
            raw.sendall(frame)
            reply = json.loads(raw.recv(65536))
            assert reply["packID"] == request["packID"] and reply["queryAddr"] == request["queryAddr"]
