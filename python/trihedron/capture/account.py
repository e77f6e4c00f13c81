"""Summary of a capture: frames saved, lost and corrupt, and the device's clock against the host's."""

from dataclasses import dataclass, field

from trihedron.arrivals import ClockLine
from trihedron.capture.timeline import Timeline

MOST_PPM = 20_000.0
"""A larger rate difference is no clock error, but a replay at another speed or a misread unit of time."""


@dataclass
class Tally:
    """Counts of frames: ``lost`` are missing by the device's counter or clock; ``garbled`` were complete, but their
    counter or timestamp contradicted their neighbours' (also counted as lost); ``repeated`` arrived twice. In
    ``uncounted`` pauses more may be lost than counted."""

    saved: int = 0
    lost: int = 0
    garbled: int = 0
    repeated: int = 0
    restarts: int = 0
    uncounted: int = 0


@dataclass
class Count:
    """Counts of frames, corrupt pieces, skipped bytes and disconnections of a capture."""

    tally: Tally = field(default_factory=Tally)
    corrupt: int = 0
    skipped_bytes: int = 0
    n_bytes: int = 0
    disconnections: int = 0
    counted_by: str = "nothing"

    @property
    def lost(self) -> int:
        """Frames sent but not in the log: by counter or clock; without either, the number of corrupt pieces."""
        return self.corrupt if self.counted_by == "nothing" else self.tally.lost

    @property
    def is_least(self) -> bool:
        """Whether ``lost`` is a lower bound: the counter restarted, or may have wrapped unnoticed in a pause."""
        return self.counted_by != "nothing" and bool(self.tally.restarts or self.tally.uncounted)

    def sentence(self) -> str:
        """The counts as one sentence, for the screen and the log's header."""
        how = {
            "counter": "by the device's counter",
            "clock": "by the device's clock",
            "nothing": "as far as remains were seen: there is no counter and no clock",
        }[self.counted_by]
        parts = [f"{self.tally.saved} saved", f"{'at least ' if self.is_least else ''}{self.lost} lost {how}"]
        for n, words in (
            (self.corrupt if self.counted_by != "nothing" else 0, "corrupt pieces seen"),
            (self.tally.garbled, "with a garbled count"),
            (self.tally.repeated, "repeated"),
            (self.disconnections, "disconnections"),
            (self.tally.restarts, "restarts of the device"),
        ):
            if n:
                parts.append(f"{n} {words}")
        return " / ".join(parts)


def clock_sentence(line: ClockLine | None, timeline: Timeline | None) -> str:
    """Offset, rate and arrival jitter as one sentence, for the screen and the log's header."""
    if line is None or timeline is None:
        return "not fitted: too short or not live"
    late = f"bytes arrive {1e3 * line.jitter_rms_s:.3g} ms rms and {1e3 * line.jitter_95_s:.3g} ms (95 %) late"
    if timeline.has_device_clock:
        if abs(line.rate_ppm) > MOST_PPM:
            return f"the device's clock runs {1.0 / line.slope:.4g} times as fast as the host's / {late}"
        return (
            f"device second = host second {line.rate_ppm:+.2f} ppm +- {line.sigma_ppm:.2f} / device zero at host "
            f"{line.offset_s:.6f} s / {late}"
        )
    sigma = 100.0 * line.sigma_slope / line.slope
    return f"{1.0 / line.slope:.6f} frames per second of the host +- {sigma:.2g} % / {late}"
