"""``trihedron diagnose``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from trihedron.cli.options import GravitySource, LogsSource, progress, with_options
from trihedron.cli.output import FullResults, leave, say
from trihedron.cli.run import name_log
from trihedron.defaults import FALSE_ALARM, check_alpha

if TYPE_CHECKING:
    from trihedron.records.results import DiagnosisResult

OPTIONS = {
    "calibration": ("FILE", "Calibration to compare with the log; otherwise one is fitted to it."),
    "against": ("SIM", "Your simulation as model: a log or a scenario (.toml, or the name of a ready-made one)."),
    "reference": ("MOTION", "Known motion beside the log: attitude, rate, pose or a log."),
    "improved": ("FILE.toml", "Write the scenario with the parameters of the log."),
    "alpha": ("P", "Chance that a healthy log is called anything but consistent."),
    "full": "Print the whole report, with every candidate.",
}


@with_options(OPTIONS, sources=LogsSource, place=GravitySource, results=FullResults)
def diagnose(
    sources: LogsSource,
    place: GravitySource,
    *,
    calibration: Path | None = None,
    against: Path | None = None,
    reference: Path | None = None,
    reference_columns: str | None = None,
    improved: Path | None = None,
    alpha: float = FALSE_ALARM,
    results: FullResults,
) -> None:
    """Where a log and its model differ, which effects are missing, and what adding them gains.

    With several logs of one unit: which effects all of them share. The exit status is 0 whatever is found.
    """
    if calibration is not None and against is not None:
        raise typer.BadParameter("give either --calibration or --against: each is the model")
    check_alpha(alpha)
    if improved is not None and (against is None or against.suffix.lower() != ".toml"):
        raise typer.BadParameter(
            "--improved goes with --against SCENARIO.toml, the file that is improved; trihedron simulate --template "
            "SCENARIO.toml writes one to begin with"
        )
    if improved is not None and against is not None and improved.resolve() == against.resolve():
        raise typer.BadParameter("--improved would overwrite the scenario that it improves; give it another name")
    results.check(improved, inputs=(*sources.files, calibration, against))
    if sources.are_many():
        if any(one is not None for one in (calibration, against, reference, improved)):
            raise typer.BadParameter("several logs are diagnosed without a model: each by itself, and what all share")
        _diagnose_many(sources, place, alpha, results)
        return
    from trihedron.files.calibration import read_calibration

    known = None if calibration is None else read_calibration(calibration)
    recording = sources.one().read()
    from trihedron.api import diagnosing
    from trihedron.files.calibration import diagnosis_document
    from trihedron.report.diagnosis import diagnosis_report, first_screen
    from trihedron.report.numbers import how_many

    with progress("diagnosing") as notify:
        result = diagnosing.diagnose(
            recording,
            **place.said,
            calibration=known,
            against=against,
            reference=reference,
            reference_columns=reference_columns,
            alpha=alpha,
            progress=notify,
        )
    document = diagnosis_report(result, str(against or calibration or ""), str(improved or ""))
    results.show(document, first_screen(result))
    doubts = sum(finding.severity.value == "warning" for finding in result.findings)
    counted = f" ({how_many(doubts, 'warning')})" if doubts else ""
    more = f"Every candidate, both models and findings{counted}: --full; pictures before and after: --report FILE.html."
    results.write(document, lambda: diagnosis_document(result), more)
    if improved is not None and against is not None:
        _improve(against, result, improved, force=results.force)
    if known is not None:
        from trihedron.api.applying import doubted

        # Differences to an untrustworthy model are no evidence of missing effects.
        leave(doubted(known))


def _diagnose_many(sources: LogsSource, place: GravitySource, alpha: float, results: FullResults) -> None:
    """Diagnose every log alone, and the effects that all share."""
    from trihedron.api import diagnosing_sessions

    given = sources.each()
    recordings = [source.read() for source in given]
    with progress("diagnosing") as notify:
        found = diagnosing_sessions.diagnose_sessions(recordings, **place.said, alpha=alpha, progress=notify)
    if found.effects:
        name_log(given[found.effects[0].surest])
    results.emit(found, sections=None)


def _improve(given: Path, result: DiagnosisResult, path: Path, *, force: bool) -> None:
    """Write the scenario with the parameters of the log; report effects that it cannot represent."""
    from trihedron.api import improving
    from trihedron.files.scenario import write_scenario

    with progress("improving the scenario") as notify:
        notify(0.1, "moving the improved scenario as the log was")
        better = improving.improve(given, result)
    for effect_id, why in better.left_out.items():
        say(f"effect {effect_id} is not in the scenario: {why}.")
    for what, ratio in better.unlike.items():
        say(
            f"the gravity error of {what} of the improved scenario is {ratio:.2f} times that of the log: "
            "this log does not separate all noise within poses from bias changes."
        )
    write_scenario(better.text, path, overwrite=force)
    say(f"improved scenario: {path}")
