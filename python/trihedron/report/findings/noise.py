"""Findings about a static log and its noise terms."""

from trihedron.report.findings.entry import NOTE, SERIOUS, WARNING, Words

_WIDENED = "Intervals were widened to allow for it."
_HEATED = "{has_temperature:? while the temperature runs from {low_degc:.1f} to {high_degc:.1f} °C|}"
_OR_LOGGED = "{has_temperature:?; `trihedron diagnose LOG` fits the temperature|, or log the temperature}"

_LOG = {
    ("repeated-rows", "static", WARNING): Words(
        "{share:.2g %} of the rows repeat the row before in every channel.",
        "the log was written faster than the sensor measures, or resampled by holding the last value.",
        "N and Q then depend on the resampling; log at the sensor's own rate.",
    ),
    ("log-uneven", "", WARNING): Words(
        "The noise changes along the log: its loudest part has {ratio:.2g} times that of the quietest.",
        "vibration that comes and goes (a fan, a machine), or a range or filter that changed.",
        "N is a mean over these levels; leave one of them: `trihedron allan LOG --exclude FROM:TO`.",
    ),
    ("log-jump", "", WARNING): Words(
        "The level jumps {n_steps:?once|{n_steps} times}, by up to {step:abs .3g} {unit:unit} at {time_s:.1f} s.",
        "the sensor or its table was moved, the supply or a heater switched, or the sensor has telegraph noise.",
        "A jump of the mean looks like K and R; each side is fitted with a mean of its own, so that K excludes it.",
    ),
    ("log-impact", "", NOTE): Words(
        "{n_impacts:# short excursion} of up to {impact:abs .3g} {unit:unit}, the largest at {time_s:.1f} s.",
        "an impact on the table, a door, a lost or damaged reading.",
        "They raise N and Q; these intervals are excluded.",
    ),
    ("log-motion", "", WARNING): Words(
        "For {shaken_s:.3g} s the readings scatter up to {times:.2g} times as much as elsewhere, first at "
        "{first_s:.1f} s.",
        "motion, vibration or handling during a log that should be static.",
        "They raise N; these intervals are excluded.",
    ),
    ("log-motion", "throughout", SERIOUS): Words(
        "Events cover {share:.0f %} of the log, too much to exclude: it is disturbed throughout.",
        "the sensor was not static.",
        "The terms describe the disturbance as much as the sensor; record a static log.",
    ),
    ("log-motion", "turns", SERIOUS): Words(
        "Gravity turns by {turn_rad:.2g !deg}° every {every_s:.2g} s: the log given as static moves.",
        "the sensor was carried, turned or flown.",
        "Its N, B and K are those of the motion; record a static log, or compare the motion with a reference: "
        "`trihedron noise LOG --reference MOTION`.",
    ),
    ("temperature-driven", "noise", WARNING): Words(
        "The temperature runs from {low_degc:.0f} to {high_degc:.0f} °C and explains up to {share:.0f %} of the slow "
        "changes of {axes:axes}: B, K and R contain it.",
        "biases follow the temperature.",
        "For B, K and R log at a constant temperature; `trihedron diagnose LOG` fits it.",
    ),
    ("log-turned", "", WARNING): Words(
        "The unit was turned by {turn_rad:.2g !deg}°, and B, K and R contain the turn; the longest interval "
        "in one direction is {start_s:.0f} to {stop_s:.0f} s.",
        "it was turned over, or its support tilted, during a log that should be static.",
        "For B, K and R take one direction alone: `trihedron allan LOG"
        "{is_first:?| --exclude :{start_s:.0f}}{is_last:?| --exclude {stop_s:.0f}:}`.",
    ),
    ("two-levels", "", WARNING): Words(
        "The level switches between two values: {axes:each; }. B, K and R describe the switching, no noise of theirs.",
        "telegraph noise of the sensor, a heater or a supply that switches.",
        "Of that axis take N alone; a filter needs a bias that jumps, or replace the sensor.",
        lines={"axes": "{v0:axis} by {v1:.3g} {v2:unit}, {v3} times, every {v4:.2g} s"},
    ),
    ("stretches-excluded", "", NOTE): Words(
        "{n_stretches:# interval} of together {excluded_s:.3g} s ({share:.2g %} of the log) excluded.",
        "",
        "Clusters there are means of the readings that remain, weighted by their number; nothing is interpolated.",
    ),
    ("clipping", "static", SERIOUS): Words(
        "{share:.2g %} of the readings lie on the same extreme value.",
        "the sensor or the ADC is at its range limit.",
        "Every term comes out too small; use a wider range or another orientation.",
    ),
    ("quantisation-dead", "", SERIOUS): Words(
        "One reading's noise ({sigma:.3g} {unit:unit}) is below half the resolution (LSB {resolution:.3g} "
        "{unit:unit}): {repeated:.0f %} of the readings repeat the one before.",
        "the resolution is coarser than the noise.",
        "N is that of the rounding, and slow terms may be smaller than the resolution; use a narrower range or a finer "
        "output.",
    ),
}

_SPECTRUM = {
    ("spectral-line", "", NOTE): Words(
        "{n_lines:# periodic line}: {strongest:each}{has_more:? and {n_more} more|}.",
        "mains, a fan, vibration of the building, or a clock inside the sensor.",
        "A line makes waves in the Allan curve near half its period; its frequencies were excluded from the fit.",
        lines={"strongest": "{v0:.4g} Hz ({v1:.2g} {v2:unit})"},
    ),
    ("spectrum-low-pass", "throughout", SERIOUS): Words(
        "No part of the upper spectrum is a sum of noise terms.",
        "resampling, a narrow filter or periodic disturbance shapes the whole band.",
        "N and Q are not those of the sensor; log at its own rate without filtering.",
    ),
    ("spectrum-low-pass", "falls", WARNING): Words(
        "Above {highest_hz:.3g} Hz the spectrum leaves the noise terms and falls to {ratio:.3g %} of them at "
        "{nyquist_hz:.3g} Hz.",
        "a low-pass filter in the sensor or the logger, or averaging by a resampler.",
        "All terms are quoted from below; averaging times under half a period of that frequency show the filter, and Q "
        "cannot be separated from it.",
    ),
    ("spectrum-unexplained", "above", WARNING): Words(
        "Above {highest_hz:.3g} Hz the spectrum leaves the noise terms; at {nyquist_hz:.3g} Hz it is {ratio:.3g %} of "
        "them.",
        "vibration, a resonance, a line of varying frequency, aliasing or resampling.",
        "All terms are quoted from below that frequency, where Q does not show.",
    ),
    ("spectrum-unexplained", "", WARNING): Words(
        "Near {frequency_hz:.2g} Hz (means of {tau_s:.2g} s) the power lies {deviation:abs .0f %} "
        "{deviation:<below|above} the fitted terms.",
        "disturbance that is not noise (temperature, daily life of the building), or noise of another shape.",
        _WIDENED,
    ),
}

_TERMS = {
    ("slow-noise-unresolved", "", NOTE): Words(
        "Slow noise is there; B and K are not separable here: B at least "
        "{flicker_lower:.2g}, at most {flicker_upper:.2g} {unit:unit}, K at least {walk_lower:.2g}, at most "
        "{walk_upper:.2g} {unit:unit}/√s, not both 0.",
        "the log is short compared with the times over which flicker and walk differ.",
        "Variances of means use the most likely sum of both; record longer to separate them.",
    ),
    ("log-drift", "", WARNING): Words(
        "The level drifts by {drift:.3g} {unit:unit} over the log ({slope:.3g} ± {sigma_slope:.1g} {unit:unit}/s)"
        f"{_HEATED}.",
        "warming up, or a change of the room's temperature.",
        f"R describes this log, not the sensor; let it warm up{_OR_LOGGED}.",
    ),
    ("log-drift", "warm-up", WARNING): Words(
        "The level changes by {drift:.3g} {unit:unit} with a time constant of {time_s:.3g} s"
        f"{_HEATED}; that was subtracted.",
        "warming up.",
        "N is that of the sensor; B and K contain what the curve leaves of the warm-up. For those of the warm sensor "
        f"leave off three time constants (`trihedron allan LOG --exclude :SECONDS`){_OR_LOGGED}.",
    ),
    ("log-drift", "wave", WARNING): Words(
        "The slow changes are a wave of period {period_s:.3g} s, amplitude {amplitude:.2g} {unit:unit}, which was "
        "subtracted.",
        "a cycle of the temperature (heating, air conditioning), or of the supply.",
        "The terms are those of the noise beside it; find what has that period, and record without it.",
    ),
    ("log-too-short", "", NOTE): Words(
        "No minimum before the log's end: K is below {limit:.2g} {unit:unit}/√s (upper limit).",
        "the log is short compared with the sensor's stability.",
        "Record longer to find the best averaging time.",
    ),
}

ENTRIES = {**_LOG, **_SPECTRUM, **_TERMS}
