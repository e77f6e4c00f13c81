"""A file that offers several streams: listed with their counts, one chosen, none taken in silence."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from trihedron.read.devices import Choice
from trihedron.read.errors import ReadError
from trihedron.read.table import StatedClock
from trihedron.records import Finding
from trihedron.records.words import Words, words

SECONDS = StatedClock(unit="s")


@dataclass(frozen=True)
class Stream:
    """``count`` messages or rows of ``topic``; ``instance`` "" where there is one only."""

    topic: str
    count: int
    instance: str = ""

    @property
    def name(self) -> str:
        """Topic and instance."""
        return f"{self.topic} {self.instance}".strip()


MOST_LISTED = 24
"""Streams that are named."""


def listed(streams: list[Stream]) -> Words:
    """Every stream with its count."""
    named = [(stream.name, stream.count) for stream in streams[:MOST_LISTED]]
    return words("streams", streams=named, has_more=len(streams) > MOST_LISTED)


def pick(path: Path, streams: list[Stream], choice: Choice, what: str) -> Stream:
    """The chosen stream, or the only one.

    Raises
    ------
    ReadError
        When there is none, none fits the choice, several do, or the one that does is empty.
    """
    if not streams:
        raise ReadError(f"{path}: {what} without readings of an accelerometer or a gyro that are known here.")
    fitting = [
        s
        for s in streams
        if (choice.topic is None or s.topic.strip("/") == choice.topic.strip("/"))
        and (choice.instance is None or s.instance == choice.instance)
    ]
    if not fitting:
        wanted = " ".join(word for word in (choice.topic, choice.instance) if word)
        raise ReadError(f"{path}: there is no {wanted} in {what}; it offers {listed(streams)}.")
    filled = [s for s in fitting if s.count]
    if not filled:
        raise ReadError(f"{path}: 0 messages in {listed(fitting)}; the sensor was not recorded.")
    if len(filled) > 1:
        first = filled[0]
        say = f"--topic {first.topic}" if len({s.topic for s in filled}) > 1 else ""
        if len({s.instance for s in filled}) > 1:
            say = f"{say} --instance {first.instance or 0}".strip()
        raise ReadError(f"{path}: {what} offers {listed(filled)}; choose one, for example {say}.")
    return filled[0]


def choice_note(kind: str, taken: Stream, streams: list[Stream]) -> tuple[Finding, ...]:
    """Which of several streams was read; nothing where there was one."""
    if len(streams) < 2:
        return ()
    from trihedron.read.devices import chosen

    return (chosen(words("this-container", kind=kind), taken.name, listed(streams), 0),)


def missing_extra(path: Path, what: str, package: str, extra: str) -> ReadError:
    """The sentence for a library that is not installed."""
    return ReadError(f"{path}: {what} is read by {package}, which is not installed: pip install 'trihedron[{extra}]'.")


def first_line(error: BaseException) -> str:
    """What a library complains about, in one line."""
    return (str(error).strip().split("\n")[0] or type(error).__name__)[:160]
