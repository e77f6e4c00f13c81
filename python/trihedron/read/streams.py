"""Streams of one file (topics, instances, datasets): the chosen one, and errors that list them."""

from dataclasses import dataclass
from pathlib import Path

from trihedron.read.devices import chosen
from trihedron.read.errors import ReadError
from trihedron.read.table import Options
from trihedron.records import Finding
from trihedron.records.words import Words, words


@dataclass(frozen=True)
class Stream:
    """``count`` messages or rows of ``topic``; ``instance`` is "" where there is only one."""

    topic: str
    count: int
    instance: str = ""

    @property
    def name(self) -> str:
        """Topic and instance as text."""
        return f"{self.topic} {self.instance}".strip()


MOST_LISTED = 24
"""Largest number of streams that are listed by name."""


def listed(streams: list[Stream]) -> Words:
    """The streams with their counts, at most ``MOST_LISTED``."""
    named = [(stream.name, stream.count) for stream in streams[:MOST_LISTED]]
    return words("streams", streams=named, has_more=len(streams) > MOST_LISTED)


def pick(path: Path, streams: list[Stream], options: Options, what: str) -> Stream:
    """The chosen stream, or the only one.

    Raises ``ReadError`` when there is no stream, none or several match the choice, or the matching one is empty.
    """
    if not streams:
        raise ReadError(f"{path}: {what} without readings of an accelerometer or a gyro that are known here.")
    fitting = [
        s
        for s in streams
        if (options.topic is None or s.topic.strip("/") == options.topic.strip("/"))
        and (options.instance is None or s.instance == options.instance)
    ]
    if not fitting:
        asked = (("topic", options.topic), ("instance", options.instance))
        wanted = " and ".join(f"{kind} {word}" for kind, word in asked if word)
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
    """The finding that names which of several streams is read; empty where there is one."""
    if len(streams) < 2:
        return ()
    return (chosen(words("this-container", kind=kind), taken.name, listed(streams), 0),)


def missing_package(path: Path, what: str, package: str) -> ReadError:
    """The error for a library that is not installed."""
    return ReadError(f"{path}: {what} is read by {package}, which is not installed: pip install {package}.")
