"""The next action after a diagnosis: what to record, store or take over."""

from pathlib import PurePath
from shlex import quote

from trihedron.records import Finding, Severity
from trihedron.records.diagnosis import Diagnosis
from trihedron.records.noise import least_length_s
from trihedron.report.calibration import errors_in_words, errors_of
from trihedron.report.diagnosis_numbers import of_another_device
from trihedron.report.diagnosis_words import (
    IN_FULL,
    OF_SAMPLES,
    dependent,
    findings_of,
    may_be_used,
    named_effects,
    own_serious,
    poses_disagree,
)
from trihedron.report.document import action_in_words
from trihedron.report.effects.catalogue import experiment
from trihedron.report.names import id_in_print, ids_in_print
from trihedron.report.numbers import capital, listed
from trihedron.report.verification import imprecise

FOUND = ("missing-physics", "unexplained")
"""Verdicts with something to do about the readings."""
FAR = 2.0
"""Error over noise from which a remedy comes before the use of a calibration."""
STORED = "`trihedron calibrate LOG --extended -o calibration.json`"
"""The command that stores the effects of a log with its S and b."""


BY_TEMPERATURE = (
    "For S and b that follow the temperature record 18 or more poses at each of three or more temperatures, and "
    "calibrate these logs together: `trihedron calibrate COLD WARM HOT --by temperature -o calibration.json`."
)
"""What to do about thermal effects of a log whose orientations determine no S and b."""


def next_step_in_words(diagnosis: Diagnosis, model: str = "", improved: str = "") -> str:
    """The next action; ``improved`` is the scenario already written with the parameters that differ."""
    use = "Store S and b and use them: `trihedron calibrate LOG -o calibration.json`."
    serious = own_serious(diagnosis)
    # An action that runs this diagnosis is done: what it found is next.
    is_done = diagnosis.verdict in FOUND and serious is not None and "`trihedron diagnose LOG`" in serious.action
    if serious is not None and not is_done:
        return dependent(diagnosis) or " ".join([action_in_words(serious), *_separation(diagnosis, "Then separate")])
    if diagnosis.verdict == "consistent":
        keep = f"Keep using {model or 'the model'}: it agrees with this log."
        if imprecise(findings_of(diagnosis)):
            keep = f"Take over the parameters of this log, which are more certain: {_taken_by(model)}."
        return dependent(diagnosis) or (keep if diagnosis.parameters else use)
    # A log of one or two orientations determines neither S nor b.
    is_static = any(one.code == "not-fit" for one in findings_of(diagnosis))
    record = "Record 18 or more poses of 3 to 5 s in different orientations (`trihedron plan`)."
    noise = "For the noise of this log: `trihedron allan LOG`."
    if diagnosis.verdict == "not-testable":
        log = getattr(diagnosis, "recording", None)
        is_short = log is not None and log.duration_s < least_length_s(log.rate_hz)
        return record if is_short else f"{record} {noise}"
    if diagnosis.verdict == "unexplained":
        return _of_unexplained(diagnosis, model)
    differs = any(p.significant for p in diagnosis.parameters)
    of_session = [effect.id for effect in diagnosis.effects if not effect.model.get("applies_to_other_recordings")]
    is_file, is_carried = model.endswith(".json"), len(of_session) < len(diagnosis.effects)
    steps = []
    if diagnosis.parameters and improved:
        has_scale = any(p.significant and p.id.endswith("-scale") for p in diagnosis.parameters)
        turned = " (a larger scale, readings per unit, is a smaller S)" if has_scale else ""
        steps.append(
            f"{improved} is your scenario with the parameters of the log{turned}: compare again, `trihedron "
            f"diagnose LOG --against {quote(improved)}`."
        )
    elif diagnosis.parameters and (differs or not is_file):
        missing = bool(named_effects(diagnosis, "recording")) and (is_carried or not is_file)
        news = [*(["the parameters that differ"] if differs else []), *(["the missing effects"] if missing else [])]
        said = listed(news or ["the noise and sampling of this log"])
        surplus = named_effects(diagnosis, "model")
        said += f", without {listed(surplus)}" if surplus else ""
        by = STORED if is_file and missing else _taken_by(model)
        other = of_another_device(diagnosis, model)
        # A log made with a calibration of another sensor is made again with the right one.
        steps.append(other.rstrip() if other and not is_file else f"{other}Take over {said}: {by}.")
    if is_static and not is_file and any("thermal" in effect.id for effect in diagnosis.effects):
        return BY_TEMPERATURE  # which separates them, too
    if not steps and may_be_used(diagnosis) and (more := _separation(diagnosis, "If the effects matter, separate")):
        return " ".join([use, *more])
    steps += _separation(diagnosis, "Then separate" if steps else "Separate")
    if steps:
        return " ".join(steps) + _by_themselves(diagnosis)
    misread = _misread(diagnosis)
    first = "" if misread is None else f"{action_in_words(misread)} "
    if is_static and not is_file:
        remedy = _in_the_next_log(diagnosis)
        return " ".join(filter(None, (f"{first}{remedy}", noise, record)))
    # The fit corrects axes, whose finding has an action of its own.
    of_session = [one for one in of_session if one not in IN_FULL]
    use = f"Keep using {model}: its parameters agree with this log." if is_file else use
    if not is_carried and not of_session:
        return f"{first}{use}{_by_themselves(diagnosis)}"
    if not is_carried:
        remedy, beside = _in_the_next_log(diagnosis), _by_themselves(diagnosis)
        if remedy and is_file and poses_disagree(diagnosis):
            return f"{first}{remedy} {use}"
        if remedy and not is_file and _is_far_from_noise(diagnosis):
            # What the effects leave unexplained leaves their calibration untrusted, too.
            is_left = any(d.disagrees for d in diagnosis.remaining if d.domain not in OF_SAMPLES)
            then = "Record again." if is_left else f"S and b of this log, fitted with the effects: {STORED}."
            return f"{first}{remedy} {then}{beside}"
        of_log = f"Another log is not corrected for {ids_in_print(dict.fromkeys(of_session))}."
        return " ".join(filter(None, (f"{first}{use} {of_log}{beside}", remedy)))
    store = f"Store the effects with the calibration: {STORED}"
    beside = f", which does not correct {ids_in_print(of_session)} in another log" if of_session else ""
    said = f"{first}{store}{beside}.{_by_themselves(diagnosis)}"
    remedy = _in_the_next_log(diagnosis) if _is_far_from_noise(diagnosis) else ""
    return " ".join(filter(None, (said, remedy)))


def _of_unexplained(diagnosis: Diagnosis, model: str) -> str:
    """What to record where no effect explains the residuals."""
    experiments = [f"{capital(one.experiment)}." for one in diagnosis.relations if one.experiment]
    left = {one.domain for one in diagnosis.domains if one.disagrees}
    clock = ", with the sensor's own sample counter or time: samples lost without a trace turn rotations short"
    is_of_moves = "moves" in left <= {"moves", "dynamics"}
    again = f"Record again{clock if is_of_moves else ''}; what returns belongs to the sensor, what does not "
    again += "to the session."
    checked = of_another_device(diagnosis, model)
    return f"{checked}{experiments[0] if experiments else again}{_by_themselves(diagnosis)}"


def _separation(diagnosis: Diagnosis, begun: str) -> list[str]:
    """The experiment that separates the first effect from those confounded with it; empty where there is none."""
    rivals = next((effect for effect in diagnosis.effects if effect.confounded_with), None)
    if rivals is None or not rivals.separating_experiment:
        return []
    return [
        f"{begun} {id_in_print(rivals.id)} from {ids_in_print(rivals.confounded_with)}: {rivals.separating_experiment}."
    ]


def _in_the_next_log(diagnosis: Diagnosis) -> str:
    """What to do about the first effect of this session alone that biases or rotations show, not a motion's force."""
    own = [one for one in diagnosis.effects if not one.model.get("applies_to_other_recordings")]
    own = [one for one in own if one.id not in IN_FULL]
    shown = (one for one in own if {held.domain for held in one.held_out} != {"dynamics"})
    advice = ((one, experiment(one.id)) for one in shown)
    return next((f"Against {id_in_print(one.id)}: {said}." for one, said in advice if said), "")


def _misread(diagnosis: Diagnosis) -> Finding | None:
    """The finding of the log's own calibration that axes are not those that their columns name."""
    own = getattr(diagnosis, "calibration", None)
    said = () if own is None else [one for one in own.findings if one.code == "left-handed"]
    return next((one for one in said if one.severity is not Severity.NOTE), None)


def _is_far_from_noise(diagnosis: Diagnosis) -> bool:
    """Whether the calibration without effects is not to be trusted, or its error beyond ``FAR`` times the noise."""
    own = getattr(diagnosis, "calibration", None)
    if own is None or any(one.severity is Severity.SERIOUS for one in own.findings):
        return own is not None
    return any(times > FAR for _, times, is_held in errors_of(own) if is_held)


def _by_themselves(diagnosis: Diagnosis) -> str:
    """Whether S and b fitted to the log may be used without the effects; empty for a given model."""
    if may_be_used(diagnosis):
        return " S and b may be used without effects: errors of poses and rotations are within noise."
    if getattr(diagnosis, "model_is_given", False) or diagnosis.parameters:
        return ""
    own = getattr(diagnosis, "calibration", None)
    if own is None or any(one.severity is Severity.SERIOUS for one in own.findings):
        return "" if own is None else " S and b without effects are not to be trusted."
    errors = errors_in_words(own)
    return f" S and b without effects may be used where these errors are acceptable: {errors}." if errors else ""


def _taken_by(model: str) -> str:
    """The option that rewrites the model, or advice for a simulated log, whose source is unknown."""
    if model.endswith(".toml"):
        return "`--improved improved.toml` writes your scenario with them"
    if model.endswith(".json"):
        return "`trihedron calibrate LOG -o updated.json`"
    # A simulated log has an ending; a ready-made scenario is a name.
    where = "your simulation, or in " if PurePath(model).suffix or not model else ""
    return (
        f"set them in {where}a scenario of your own (`trihedron simulate --template sensor.toml`), by "
        "`trihedron diagnose LOG --against sensor.toml --improved improved.toml`"
    )
