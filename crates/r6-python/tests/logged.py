"""The log of a virtual controller, as data."""

from collections.abc import Iterable

import r6


def commands(lines: Iterable[r6.LogLine]) -> list[str]:
    """The commands that the controller answered with ok."""
    return [line.event["command"] for line in lines if line.event["event"] == "command_accepted"]


def lists(lines: Iterable[r6.LogLine]) -> list[int]:
    """The number of instructions in each list that the controller took."""
    return [line.event["instructions"] for line in lines if line.event["event"] == "list_taken"]
