"""What the log of a virtual controller tells, as data."""

from collections.abc import Iterable

import r6


def commands(lines: Iterable[r6.LogLine]) -> list[str]:
    """The commands that it was given and answered with ok."""
    return [line.event["command"] for line in lines if line.event["event"] == "command_accepted"]


def lists(lines: Iterable[r6.LogLine]) -> list[int]:
    """The lists that it took: how many instructions each had."""
    return [line.event["instructions"] for line in lines if line.event["event"] == "list_taken"]
