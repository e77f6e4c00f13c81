"""Charts as HTML: marks as SVG that scales with the panel, axes and text as HTML that does not."""

import math
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.report.chart import (
    UNITS,
    Band,
    Bars,
    Chart,
    Level,
    Line,
    Mark,
    Panel,
    Places,
    Points,
    Span,
    limits_of,
    ticks,
)
from trihedron.report.numbers import plain_number, with_sigma

COARSE = 10
"""Resolution of long curves, in units of a panel; finer steps are not visible."""
FEW_LETTERS = 20
"""Most characters of the tick labels below a panel on a phone; beyond, every other number is hidden there, and
names take two lines."""
LONG = 500
BETWEEN = "|"
"""Separator between the tooltips of the dots, or the bars, of one path."""
FEWEST_SAID = 2
MOST_LETTERS = 32
"""Most characters of all names below a panel of half a page; beyond, positions are numbered instead."""


def drawn(chart: Chart, caption: str) -> str:
    """The chart as HTML with inline SVG; ``caption`` is the label of each panel for screen readers."""
    link = " data-linked" if chart.is_linked else ""
    parts = [_legend(chart)] if chart.legend else []
    parts.append(f'<div class="panels n{chart.columns}"{link}>')
    parts += [_panel(panel, caption, _surroundings(chart)) for panel in chart.panels]
    parts.append("</div>")
    return "".join(parts)


def _surroundings(chart: Chart) -> tuple[int, bool]:
    """Alignment of panels: width of the y labels [letters] in a column of panels; a title line in a row of panels."""
    if chart.columns > 1:
        return 0, any(panel.title for panel in chart.panels)
    return max((_letters(_y_ticks(panel)) for panel in chart.panels), default=0), False


def _y_ticks(panel: Panel) -> list[tuple[float, str]]:
    if panel.y.names:
        return [(-float(k), name) for k, name in enumerate(panel.y.names, 1)]
    _, (low, high) = limits_of(panel)
    return ticks(low, high, is_log=panel.y.is_log, whole=panel.y.whole, most=5)


def _letters(said: Sequence[tuple[float, str]]) -> int:
    return max((len(word) for _, word in said), default=1)


def _legend(chart: Chart) -> str:
    seen: dict[str, str] = {}
    for panel in chart.panels:
        for mark in panel.marks:
            if mark.name and mark.name not in seen:
                seen[mark.name] = _swatch(mark)
    if not seen:
        return ""
    items = "".join(
        f'<span class="key"><i class="{kind}" aria-hidden="true"></i>{escape(name)}</span>'
        for name, kind in seen.items()
    )
    return f'<div class="legend">{items}</div>'


def _swatch(mark: Mark) -> str:
    shape = {Line: "ln", Points: "dot", Bars: "box", Band: "box", Span: "box back", Level: "ln"}[type(mark)]
    if (isinstance(mark, Line | Level) and mark.is_dashed) or (isinstance(mark, Points) and mark.is_hollow):
        shape += " open"
    return f"{shape} {mark.colour}"


def _panel(panel: Panel, caption: str, around: tuple[int, bool]) -> str:
    at = Places(panel)
    (x0, x1), (y0, y1) = at.x_limits, at.y_limits
    x_ticks = ticks(x0, x1, is_log=panel.x.is_log, whole=panel.x.whole, most=4 if panel.y.names else 6)
    if _has_room_for_names(panel):
        x_ticks = [(float(k), name) for k, name in enumerate(panel.x.names, 1)]
    y_ticks = _y_ticks(panel)
    xs, ys = at.x([t for t, _ in x_ticks]), at.y([t for t, _ in y_ticks])
    grid = "".join(f"M{x:.0f} 0V{UNITS}" for x in xs) + "".join(f"M0 {y:.0f}H{UNITS}" for y in ys)
    x_words = "".join(_word(w, f"left:{x / UNITS:.2%}") for x, (_, w) in zip(xs, x_ticks, strict=True) if w)
    y_words = "".join(_word(w, f"top:{y / UNITS:.2%}") for y, (_, w) in zip(ys, y_ticks, strict=True) if w)
    label_width = max(around[0], _letters(y_ticks))
    is_dense = sum(map(len, (word for _, word in x_ticks))) > FEW_LETTERS
    dense = "" if not is_dense else " named" if panel.x.names else " dense"
    back = [_mark(mark, at) for mark in panel.marks if isinstance(mark, Band)] + _spans(panel, at)
    front = [_mark(mark, at) for mark in panel.marks if not isinstance(mark, Band | Span)]
    about = f"{panel.title}: {caption}" if panel.title else caption
    title = f'<div class="ptitle">{escape(panel.title) or "&nbsp;"}</div>' if panel.title or around[1] else ""
    spec = f'data-x="{x0:.9g} {x1:.9g}" data-y="{y0:.9g} {y1:.9g}" data-ux="{escape(panel.x.unit)}" '
    spec += f'data-uy="{escape(panel.y.unit)}" data-lx="{escape(panel.x.label)}"'
    spec += (" data-xlog" if panel.x.is_log else "") + (" data-ylog" if panel.y.is_log else "")
    spec += " data-xwhole" if panel.x.whole else ""
    if _has_room_for_names(panel):
        spec += f' data-xnames="{escape("|".join(panel.x.names))}"'
    spec += f' data-ynames="{escape("|".join(panel.y.names))}"' if panel.y.names else ""
    kind = "panel map" if panel.is_map else "panel"
    return (
        f'<div class="{kind}" {spec} style="--labels:{label_width}ch;--high:{panel.height_px}px">{title}'
        f'<div class="ylabel">{escape(panel.y.label)}</div>'
        f'<div class="yticks" aria-hidden="true">{y_words}</div>'
        f'<div class="plot"><svg role="img" aria-label="{escape(about)}" viewBox="0 0 {UNITS} {UNITS}" '
        f'preserveAspectRatio="none"><g class="back">{"".join(back)}</g><path class="grid" d="{grid}"/>'
        f'<g class="front">{"".join(front)}</g></svg></div>'
        f'<div class="xticks{dense}" aria-hidden="true">{x_words}</div>'
        f'<div class="xlabel">{escape(panel.x.label)}</div></div>'
    )


def _has_room_for_names(panel: Panel) -> bool:
    return 0 < len("".join(panel.x.names)) <= MOST_LETTERS


def _word(text: str, place: str) -> str:
    return f'<span style="{place}">{escape(text)}</span>'


def _mark(mark: Mark, at: Places) -> str:
    if isinstance(mark, Line):
        thin = (" dash" if mark.is_dashed else "") + (" thin" if mark.is_thin else "")
        # Shaded bars of noise are not a curve, and have no tooltip.
        name = f' data-n="{escape(mark.name)}"' if mark.name and mark.colour != "shade" else ""
        x, y = at.x(mark.x), at.y(mark.y)
        if len(x) < LONG:
            return f'<path class="ln {mark.colour}{thin}"{name} d="{_path(x, y)}"/>'
        steps = f'data-k="{COARSE}" transform="scale({COARSE})"'
        return f'<path class="ln {mark.colour}{thin}"{name} {steps} d="{_path(x / COARSE, y / COARSE)}"/>'
    if isinstance(mark, Points):
        return _points(mark, at)
    if isinstance(mark, Bars):
        return _bars(mark, at)
    if isinstance(mark, Band):
        return _band(mark, at)
    if isinstance(mark, Level):
        dash = " dash" if mark.is_dashed else ""
        where = f"M{float(at.x(mark.x or 0.0)):.0f} 0V{UNITS}"
        if mark.y is not None:
            where = f"M0 {float(at.y(mark.y)):.0f}H{UNITS}"
        return f'<path class="level {mark.colour}{dash}" d="{where}"/>'
    return ""


def _spans(panel: Panel, at: Places) -> list[str]:
    """All spans of one colour as one path, in the order of first use."""
    places: dict[str, str] = {}
    for mark in panel.marks:
        if isinstance(mark, Span):
            first, last = at.x([mark.first, mark.last])
            where = f"M{first:.0f} 0H{last:.0f}V{UNITS}H{first:.0f}z"
            places[mark.colour] = places.get(mark.colour, "") + where
    return [f'<path class="area {colour}" d="{where}"/>' for colour, where in places.items()]


def _path(x: FloatArray, y: FloatArray) -> str:
    """SVG path of relative steps in whole units, so that every point is within half a unit."""
    good = np.isfinite(x) & np.isfinite(y)
    xi = np.round(np.where(good, x, 0.0)).astype(int).tolist()
    yi = np.round(np.where(good, y, 0.0)).astype(int).tolist()
    out: list[str] = []
    before: tuple[int, int] | None = None
    for a, b, is_good in zip(xi, yi, good.tolist(), strict=True):
        if not is_good:
            before = None
            continue
        if before is None:
            # A lone point before a gap has no step.
            if out and out[-1].endswith("l"):
                out[-1] = out[-1][:-1]
            out.append(f"M{a} {b}l")
        else:
            dx, dy = a - before[0], b - before[1]
            out.append(f"{dx}{dy}" if dy < 0 else f"{dx} {dy}")
            out.append(" ")
        before = (a, b)
    return "".join(out).rstrip(" l")


def _points(mark: Points, at: Places) -> str:
    xs, ys = at.x(mark.x), at.y(mark.y)
    sigma = np.zeros(len(xs)) if mark.sigma is None else np.where(np.isfinite(mark.sigma), mark.sigma, 0.0)
    out = []
    if mark.sigma is not None:
        place, middle = (at.x, mark.x) if mark.is_across else (at.y, mark.y)
        ends = (place(middle - sigma), place(middle + sigma))
        bars = "".join(
            f"M{a:.0f} {y:.0f}H{b:.0f}" if mark.is_across else f"M{x:.0f} {a:.0f}V{b:.0f}"
            for x, y, a, b in zip(xs, ys, *ends, strict=True)
            if math.isfinite(x + y + a + b)
        )
        out.append(f'<path class="err {mark.colour}" d="{bars}"/>')
    first, last = shared_ends(mark.said)
    seen = [k for k, (x, y) in enumerate(zip(xs, ys, strict=True)) if math.isfinite(x + y)]
    if not seen:
        return "".join(out)
    places = "".join(f"M{xs[k]:.0f} {ys[k]:.0f}h0" for k in seen)
    tips = _tips(mark.said, seen, first, last)
    hole = f'<path class="hole" d="{places}"/>' if mark.is_hollow else ""
    out.append(
        f'<g class="{mark.colour}"><path class="dot" data-a="{escape(first)}" data-z="{escape(last)}" '
        f'data-t="{tips}" d="{places}"/>{hole}</g>'
    )
    return "".join(out)


def _tips(said: Sequence[str], seen: Iterable[int], first: str, last: str) -> str:
    """Tooltips of the marks ``seen`` of one path, without their common beginning and end."""
    parts = (said[k][len(first) : len(said[k]) - len(last)] for k in seen)
    return escape(BETWEEN.join(part.replace(BETWEEN, "¦") for part in parts))


def shared_ends(said: Sequence[str]) -> tuple[str, str]:
    """Common beginning and end of all tooltips, written once per path to keep the page small."""
    if len(said) < FEWEST_SAID:
        return "", ""
    n = _shared(said)
    m = min(_shared([one[::-1] for one in said]), min(map(len, said)) - n)
    return said[0][:n], said[0][len(said[0]) - m :]


def _shared(texts: Sequence[str]) -> int:
    """Number of letters with which all texts begin."""
    least, most = min(texts), max(texts)
    return next((k for k, (a, b) in enumerate(zip(least, most, strict=False)) if a != b), len(least))


def _bars(mark: Bars, at: Places) -> str:
    half = mark.width / 2
    ends = np.column_stack([at.x(mark.x - half), at.y(np.zeros(len(mark.x))), at.y(mark.y), at.x(mark.x + half)])
    seen = np.flatnonzero(np.isfinite(ends).all(axis=1))
    if not len(seen):
        return ""
    places = "".join(f"M{a:.0f} {f:.0f}V{t:.0f}H{b:.0f}V{f:.0f}z" for a, f, t, b in ends[seen])
    first, last = shared_ends(mark.said)
    return (
        f'<path class="area {mark.colour}" data-a="{escape(first)}" data-z="{escape(last)}" '
        f'data-t="{_tips(mark.said, seen, first, last)}" d="{places}"/>'
    )


def _band(mark: Band, at: Places) -> str:
    good = np.isfinite(mark.x) & np.isfinite(mark.lower) & np.isfinite(mark.upper)
    if not np.any(good):
        return ""
    x = np.concatenate([mark.x[good], mark.x[good][::-1]])
    y = np.concatenate([mark.upper[good], mark.lower[good][::-1]])
    return f'<path class="area {mark.colour}" d="{_path(at.x(x), at.y(y))}z"/>'


def envelope(x: FloatArray, y: FloatArray, most: int = 1000) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest value of each block, so that a long log keeps its peaks."""
    n = len(y)
    if n <= most:
        return x, y
    block = -(-n // (most // 2))
    whole = n // block * block
    parts = y[:whole].reshape(-1, block)
    good = np.isfinite(parts)
    low_high = np.column_stack([np.where(good, parts, np.inf).min(1), np.where(good, parts, -np.inf).max(1)])
    low_high[~good.any(axis=1)] = np.nan
    middle = x[:whole].reshape(-1, block)
    return np.column_stack([middle[:, 0], middle[:, block // 2]]).ravel(), low_high.ravel()


def said(what: str, value: float, unit: str, sigma: float | None = None) -> str:
    """Tooltip of a point: ``pose 7: 1.53 ± 0.98 mm/s²``."""
    number = plain_number(value) if sigma is None else with_sigma(value, sigma)
    return f"{what}: {number} {unit}".strip()
