"""``trihedron noise``."""

from dataclasses import replace
from pathlib import Path

from trihedron.cli.options import GravitySource, LogSource, numbers, progress, with_options
from trihedron.cli.output import FIRST_SCREEN, FullResults, put, say
from trihedron.files.output import write_whole

OPTIONS = {
    "static": ("STATIC", "Static log of the unit, or JSON of trihedron allan; default: poses of 20 s in the log."),
    "reference": ("MOTION", "Known motion beside the log: attitude, or pose."),
    "band": ("HZ", "Look for vibration above this; default: a quarter of the sampling rate."),
    "horizon": ("LIST", "Seconds without updates of the filter: '1,10,60'."),
    "to": (
        "TARGET",
        "Write N and K for kalibr, openvins, vins-fusion, basalt, orb-slam3, fast-lio, gtsam, robot_localization.",
    ),
    "output": ("FILE", "Where --to writes; '-' is stdout, without the report.", "-o"),
    "full": "Print the cross-validation and all findings as well.",
}


@with_options(OPTIONS, source=LogSource, place=GravitySource, results=FullResults)
def noise(
    source: LogSource,
    place: GravitySource,
    *,
    static: Path | None = None,
    reference: Path | None = None,
    reference_columns: str | None = None,
    band: float | None = None,
    horizon: str = "1,10,60",
    to: str | None = None,
    output: Path = Path("-"),
    results: FullResults,
) -> None:
    """Noise densities N and K for your filter: those of motion beside those of a static log."""
    horizons = numbers("--horizon", horizon)
    results.check(None if to is None else output, inputs=(*source.files, static, reference))
    recording = source.read()
    from trihedron.api import filter_noising
    from trihedron.files.formats.filter_noise import filter_noise_text
    from trihedron.report.filter_noise import filter_noise_record, filter_noise_report

    with progress("estimating"):
        found = filter_noising.filter_noise(
            recording,
            static=static,
            reference=reference,
            reference_columns=reference_columns,
            band_hz=band,
            horizons_s=horizons,
            **place.said,
        )
    text = "" if to is None else filter_noise_text(found, to)
    document = filter_noise_report(found)
    if text:
        document = replace(document, next_step=f"Put the values of {to} into your filter.")
    if text and str(output) == "-":
        put(text)
    else:
        results.show(document, FIRST_SCREEN)
        if text:
            write_whole(output, text, overwrite=results.force)
            say(f"noise for {to}: {output}")
    more = "The test on the other half: --full; with the picture: --report FILE.html."
    results.write(document, lambda: filter_noise_record(found), more)
    results.leave(found.findings)
