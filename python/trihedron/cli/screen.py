"""The guide on a terminal: a screen of 80 × 24 or larger, in plain characters for light and dark themes."""

import math
import re
from collections.abc import Sequence
from textwrap import wrap

from rich.console import Group
from rich.panel import Panel
from rich.text import Text

from trihedron.records.guiding import Examination, GuideView, Phase, Uncertain
from trihedron.report.numbers import how_many

# Names of the sixteen ANSI colours, which follow the terminal's theme.
GOOD, BAD, DIM, STRONG = "green", "red", "dim", "bold"

_ASIDE = re.compile(r" \([^)]*\)")


def bar(share: float, width: int) -> str:
    """A bar that is full at 1."""
    n = round(min(max(share, 0.0), 1.0) * width)
    return "#" * n + "-" * (width - n)


def percent(value: float | None) -> str:
    """A fraction in per cent with two digits, or a dash."""
    return "--" if value is None else f"{100.0 * value:.2g}"


def screen(view: GuideView, width: int = 80, height: int = 24, *, lost: int = 0, seconds: float | None = None) -> Group:
    """The whole screen as a rich renderable."""
    inner = width - 4
    state = Text("STILL " if view.is_still else "MOVING", style=f"{STRONG} {GOOD if view.is_still else DIM}")
    head = Text.assemble(state, "  ", Text(view.instruction, style=STRONG))
    full = bar(view.held_s / max(view.pose_s, 0.1), inner - 24)
    pose = f"pose  [{full}] {min(view.held_s, 99.9):4.1f} of {view.pose_s:.0f} s"
    lines: list[Text] = [head, Text(view.detail, style=DIM), Text(pose)]
    angle = view.degrees_to_target
    if angle is not None and view.phase in (Phase.MOVE, Phase.CHECK):
        lines[1].append(f"  ({angle:.0f} degrees to go)")
    known = view.examination
    body = _parameters(known, tall=height >= 36)
    # Facts that do not fit are omitted, the last first.
    facts = [how_many(view.n_poses, "pose"), *([] if known is None else [_to_go(known)]), f"{lost} lost"]
    facts += [] if seconds is None else [f"{seconds:.0f} s"]
    if known is not None:
        facts.append(f"{known.rate_hz:.4g} Hz")
    while len(" | ".join(facts)) > inner:
        facts.pop()
    most = max(height - 8 - len(body.plain.splitlines()), 1)
    warned = [Text(line, style=BAD, no_wrap=True) for line in _in_lines(view.warnings, inner - 1, most)]
    foot = Text(" | ".join(facts), style=DIM, no_wrap=True)
    title = f"trihedron guide: {view.accuracy.sentence()}"
    return Group(Panel(Group(*lines, Text(""), body, Text(""), *warned, foot), title=title, width=width))


def _in_lines(warnings: Sequence[str], width: int, most: int) -> list[str]:
    """The first warnings in at most ``most`` lines: without asides where they do not fit; a cut is marked by dots."""
    lines = _wrapped(warnings, width)
    if len(lines) > most:
        lines = _wrapped([_ASIDE.sub("", text) for text in warnings], width)
    if len(lines) > most:
        lines[most - 1 :] = [f"{lines[most - 1][: width - 4].rstrip()} ..."]
    return lines


def _wrapped(warnings: Sequence[str], width: int) -> list[str]:
    return [line for text in warnings for line in wrap(f"! {text}", width, subsequent_indent="  ")]


def _to_go(known: Examination) -> str:
    if known.is_good_enough:
        return "accuracy reached"
    if known.poses_needed is None:
        return "accuracy far off"
    return f"at least {known.poses_needed} more"


def _parameters(known: Examination | None, *, tall: bool) -> Text:
    """Uncertainties now, after the next pose and wanted: all parameters if ``tall``, else the worst of each kind."""
    if known is None:
        return Text("after the first poses", style=DIM)
    columns = 32 if tall else 14
    out = Text(f"{'uncertainty, %':{columns}s}{'now':>6}{'next':>7}{'goal':>6}\n", style=DIM)
    rows = list(known.uncertain) if tall else _groups(known.uncertain)
    for one in rows:
        name = f"{'accel' if one.sensor == 'accelerometer' else 'gyro'} {one.name}"[: columns - 1]
        good = one.now is not None and one.now <= one.wanted
        numbers = f"{percent(one.now):>6}{percent(one.after_next):>7}{percent(one.wanted):>6}"
        out.append(f"{name:{columns}s}{numbers} {'ok' if good else ''}\n", style=GOOD if good else "")
    return out


def _groups(all_of_them: tuple[Uncertain, ...]) -> list[Uncertain]:
    """The worst of every kind, seven lines at most."""
    groups: dict[tuple[str, str], list[Uncertain]] = {}
    for one in all_of_them:
        kind = "scales" if one.name.startswith("scale") else "biases" if one.name.startswith("bias") else "angles"
        groups.setdefault((one.sensor, kind), []).append(one)
    out = []
    for (sensor, kind), members in groups.items():
        worst = max(members, key=lambda one: math.inf if one.now is None else one.now)
        after = [one.after_next for one in members if one.after_next is not None]
        out.append(Uncertain(sensor, kind, worst.now, max(after, default=None), worst.wanted))
    return out


def as_text(view: GuideView, width: int = 80, height: int = 24) -> str:
    """The screen as plain text: for tests and documentation."""
    from rich.console import Console

    console = Console(width=width, height=height, color_system=None, force_terminal=False, legacy_windows=False)
    with console.capture() as captured:
        console.print(screen(view, width, height))
    return captured.get()
