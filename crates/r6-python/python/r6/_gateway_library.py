"""Programs and points that a gateway keeps by name, read from its JSON. An answer of another shape is
refused: an arm may be moved by these texts and numbers."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from ._gateway_http import header

_ETAG = re.compile(r'"[!#-~]+"')
_SHA256 = re.compile(r"[0-9a-f]{64}")

_MOST_AXES = 8
"""The most axes of an arm."""

_POSE = 6
"""The numbers of a pose: X, Y, Z, U, V, W."""

_FARTHEST = 1e6
"""The farthest number of a point, degrees or mm: beyond all arms. A gateway keeps none beyond it."""

T = TypeVar("T")


@dataclass(frozen=True)
class _Version:
    """What each version of a program or a point has."""

    name: str
    version: int
    """Its number, from 1. A name that was removed and stored again counts from 1 again: compare
    ``sha256``."""
    etag: str
    """Pass this version, or its ``etag``, as ``expected`` to change or to remove what has this name."""
    sha256: str
    """SHA-256 of what is stored, as 64 hexadecimal digits. That of a program is of its text in UTF-8:
    ``GatewayLease.run`` takes it."""
    stored_at: str
    """RFC 3339, UTC."""
    stored_by: str
    """Who stored it: a user, or the number and the name of a token."""


@dataclass(frozen=True)
class GatewayProgram(_Version):
    """One version of a program that a gateway keeps."""

    size: int
    """The length of the text, in bytes."""
    kind: str
    """``"instructions"``, which a gateway can run, ``"taught"`` or ``"neither"``."""
    ok: bool
    """Whether it had no mistake when it was stored."""
    steps: int
    text: str | None = field(repr=False)
    """The text. ``None`` in lists: ``Gateway.program`` has it."""

    @classmethod
    def _of(cls, data: Mapping[str, Any], text: str | None = None) -> GatewayProgram:
        return cls(
            *_head(data),
            size=_count(data["bytes"]),
            kind=_typed(data["kind"], str),
            ok=_typed(data["ok"], bool),
            steps=_count(data["steps"]),
            text=text,
        )


@dataclass(frozen=True)
class GatewayPoint(_Version):
    """One version of a place of an arm that a gateway keeps. It has ``axes``, ``pose`` or both."""

    robot: str | None
    """The robot whose place it is; ``None`` if that was not said."""
    axes: tuple[float, ...] | None
    """Where the axes stand, J1 first: degrees, or mm of a sliding axis. 1 to 8 numbers."""
    pose: tuple[float, ...] | None
    """Where the tool is: X, Y, Z in mm; U, V, W in degrees."""
    tool: int | None
    """The number of the tool that ``pose`` is of; ``None`` if that was not said."""
    work_frame: int | None
    """The number of the work frame that ``pose`` is in; ``None`` if that was not said."""
    note: str

    @classmethod
    def _of(cls, data: Mapping[str, Any]) -> GatewayPoint:
        value = data["value"]
        axes, pose = _numbers(value["axes"]), _numbers(value["pose"])
        if axes is None and pose is None:
            raise ValueError("a point without a place")
        if axes is not None and not 1 <= len(axes) <= _MOST_AXES:
            raise ValueError(f"a point with {len(axes)} axes")
        if pose is not None and len(pose) != _POSE:
            raise ValueError(f"a pose of {len(pose)} numbers")
        return cls(
            *_head(data),
            robot=None if value["robot"] is None else _typed(value["robot"], str),
            axes=axes,
            pose=pose,
            tool=None if value["tool"] is None else _count(value["tool"]),
            work_frame=None if value["work_frame"] is None else _count(value["work_frame"]),
            note=_typed(value["note"], str),
        )


def if_match(name: str, expected: GatewayProgram | GatewayPoint | str | None) -> dict[str, str]:
    """The header that says which version a change is for. ``ValueError`` if it is a version of another
    name."""
    if expected is None:
        return {}
    if isinstance(expected, str):
        return {"If-Match": header(expected, "etag")}
    if expected.name != name:
        raise ValueError(f"expected is a version of {expected.name!r}, and not of {name!r}")
    return {"If-Match": header(expected.etag, "etag")}


def sha256_of(text: str) -> str:
    """SHA-256 of a text in UTF-8. ``ValueError`` if it has half a character, which no file in UTF-8 has."""
    return hashlib.sha256(text.encode()).hexdigest()


def read_programs(answer: Any) -> list[GatewayProgram]:
    return [GatewayProgram._of(program) for program in answer["programs"]]


def read_program_versions(answer: Any, name: str) -> list[GatewayProgram]:
    versions = [GatewayProgram._of(version) for version in answer["versions"]]
    return [_same(version, name) for version in versions]


def read_program(answer: Any, name: str, version: int | None) -> GatewayProgram:
    """A program with its text: the version that the caller asked for, with the text of its ``sha256``."""
    text = _typed(answer["program"], str)
    program = _same(GatewayProgram._of(answer, text), name, version)
    if program.sha256 != sha256_of(text) or program.size != len(text.encode()):
        raise ValueError("a program with another text than its sha256 says")
    return program


def read_stored_program(answer: Any, name: str, text: str) -> GatewayProgram:
    """A program that was stored. It has to be this text."""
    program = _same(GatewayProgram._of(answer, text), name)
    if program.sha256 != sha256_of(text):
        raise ValueError("another text was stored")
    return program


def read_points(answer: Any) -> list[GatewayPoint]:
    return [GatewayPoint._of(point) for point in answer["points"]]


def read_point_versions(answer: Any, name: str) -> list[GatewayPoint]:
    return [_same(GatewayPoint._of(version), name) for version in answer["versions"]]


def read_point(answer: Any, name: str, version: int | None = None) -> GatewayPoint:
    return _same(GatewayPoint._of(answer), name, version)


Kept = TypeVar("Kept", GatewayProgram, GatewayPoint)


def _same(kept: Kept, name: str, version: int | None = None) -> Kept:
    """What was asked for, and nothing else."""
    if kept.name != name or version not in (None, kept.version):
        raise ValueError(f"version {kept.version} of {kept.name!r}, which was not asked for")
    return kept


def _head(data: Mapping[str, Any]) -> tuple[str, int, str, str, str, str]:
    """What each version has: name, number, etag, sha256, when and by whom it was stored."""
    name, version = _typed(data["name"], str), _count(data["version"])
    etag, sha256 = _typed(data["etag"], str), _typed(data["sha256"], str)
    if version < 1 or not _ETAG.fullmatch(etag) or not _SHA256.fullmatch(sha256):
        raise ValueError("a version without its number, etag or sha256")
    return name, version, etag, sha256, _typed(data["stored_at"], str), _typed(data["stored_by"], str)


def _typed(value: object, kind: type[T]) -> T:
    """The value, which has to have this type: in Python ``True`` is an ``int`` too."""
    if not isinstance(value, kind) or type(value) is not kind:
        raise ValueError(f"{value!r} is no {kind.__name__}")
    return value


def _count(value: object) -> int:
    number = _typed(value, int)
    if number < 0:
        raise ValueError(f"{number} is below 0")
    return number


def _numbers(values: object) -> tuple[float, ...] | None:
    """Numbers that an arm could be told; ``None`` without any."""
    if values is None:
        return None
    numbers = tuple(value if isinstance(value, float) else float(_typed(value, int)) for value in _typed(values, list))
    # NaN is not at most anything.
    if not all(abs(number) <= _FARTHEST for number in numbers):
        raise ValueError("a number that no arm reaches")
    return numbers
