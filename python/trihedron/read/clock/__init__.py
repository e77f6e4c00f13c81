"""The time base of a log: its unit, its order, its rate, and whether its timestamps are when the samples were taken."""

from trihedron.read.clock.base import Clock, build_clock
from trihedron.read.clock.rate import mean_rate_hz
from trihedron.read.clock.settle import Settled, settle_clock
from trihedron.read.clock.unit import TICKS, Witness, counts_rows, parse_time_unit, seconds_of, was_weighed, with_gyro

__all__ = [
    "TICKS",
    "Clock",
    "Settled",
    "Witness",
    "build_clock",
    "counts_rows",
    "mean_rate_hz",
    "parse_time_unit",
    "seconds_of",
    "settle_clock",
    "was_weighed",
    "with_gyro",
]
