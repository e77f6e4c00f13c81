"""Scenarios ready-made by name and in files (TOML): profile, session or steps, overrides of parameters, effects."""

import dataclasses
import enum
import inspect
import typing
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.documents import parse_toml, read_toml
from trihedron.errors import InputError
from trihedron.sanitise import meant
from trihedron.simulate.accelerometer import Accelerometer
from trihedron.simulate.effects import with_effect
from trihedron.simulate.gyroscope import Gyroscope
from trihedron.simulate.motion.attitude import attitude_with_up
from trihedron.simulate.motion.steps import LEVEL, Disturb, Motion, MoveTo, Oscillate, Pose, Turn, Vibrate
from trihedron.simulate.profiles import profile_by_name
from trihedron.simulate.scenario import Clock, Environment, Scenario
from trihedron.simulate.sessions import SESSIONS

_STEPS: dict[str, type[Any]] = {
    "pose": Pose,
    "move": MoveTo,
    "turn": Turn,
    "oscillate": Oscillate,
    "vibrate": Vibrate,
    "disturb": Disturb,
}
_TOP = ("name", "about", "profile", "unit", "session", "start_up", "table_tilt_deg", "step", "clock", "environment")
_KEYS = (*_TOP, "accelerometer", "gyroscope", "effect")


def read_scenario(path: str | Path) -> Scenario:
    """Read a scenario file.

    Raises ``InputError`` when the file is not TOML or a table, key or name in it does not exist; the message names
    table and key.
    """
    path = Path(path)
    table = read_toml(path, "scenario file")
    try:
        return scenario_from_table(table, path.stem)
    except (TypeError, OverflowError, LookupError):
        kinds = "unit is a whole number, table_tilt_deg two numbers, an effect a table"
        raise InputError(f"{path.name}: a value is of another kind than its key takes ({kinds}).") from None
    except ValueError as error:
        raise InputError(f"{path.name}: {error}") from None


_TABLES = {"clock": Clock, "environment": Environment, "accelerometer": Accelerometer, "gyroscope": Gyroscope}

_MOST_POSES = 100_000
"""Largest number of poses of a session; poses of 2 s then take more than two days."""


def scenario_from_table(table: Mapping[str, Any], name: str = "scenario") -> Scenario:
    """A scenario from the tables of a TOML file."""
    _reject_unknown(table, _KEYS, "the file")
    profile = profile_by_name(str(table.get("profile", "mpu")))
    accelerometer, gyroscope = profile.accelerometer, profile.gyroscope
    if "unit" in table:
        accelerometer, gyroscope = profile.unit(int(table["unit"]))
    scenario = Scenario(
        motion=_motion(table),
        name=str(table.get("name", name)),
        accelerometer=_sensor(accelerometer, table, "accelerometer"),
        gyroscope=_sensor(gyroscope, table, "gyroscope"),
        clock=_changed(profile.clock, table.get("clock", {}), "clock"),
        environment=_environment(table.get("environment", {})),
    )
    effects = table.get("effect", [])
    if not isinstance(effects, list):
        raise InputError("effects are written as [[effect]], each with its id")
    for effect in effects:
        size = dict(effect)
        if "id" not in size:
            raise InputError('an [[effect]] needs its id, such as id = "gyro-g-sensitivity"')
        scenario = with_effect(scenario, str(size.pop("id")), **size)
    return scenario


def _environment(table: Any) -> Environment:
    """The environment; gravity is WGS84's where the table gives a latitude or a height and no gravity."""
    given = _changed(Environment(), table, "environment")
    if {"latitude_deg", "height_m"} & set(table) and "gravity_m_s2" not in table:
        given = dataclasses.replace(given, gravity_m_s2=0.0)
    return typing.cast(Environment, given)


def _motion(table: Mapping[str, Any]) -> Motion:
    if "step" in table and "session" in table:
        raise InputError("give either a session or [[step]] tables, not both")
    if "step" in table:
        steps = []
        for k, entry in enumerate(table["step"]):
            values = dict(entry)
            kind = str(values.pop("kind", ""))
            if kind not in _STEPS:
                raise InputError(f"step {k} is of kind {kind!r}; there are {', '.join(_STEPS)}")
            steps.append(_made(_STEPS[kind], values, f"step {k} ({kind})"))
        start = attitude_with_up(table["start_up"]) if "start_up" in table else LEVEL
        motion = Motion(tuple(steps), start)
    else:
        values = dict(table.get("session", {"kind": "hand"}))
        kind = str(values.pop("kind", "hand"))
        if kind not in SESSIONS:
            raise InputError(f"no session is of kind {kind!r}; there are {', '.join(SESSIONS)}")
        values = {key: _tupled(value) for key, value in values.items()}
        for key, value in values.items():
            if isinstance(value, int) and abs(value) > _MOST_POSES:
                raise InputError(f"session {kind}: {key} is {value:.3g}, and a session has at most {_MOST_POSES}")
        known = list(inspect.signature(SESSIONS[kind]).parameters)
        for key in values:
            if key not in known:
                raise InputError(f"session {kind}: there is no {key!r}; there are kind, {', '.join(known)}")
        try:
            motion = SESSIONS[kind](**values)
        except TypeError as error:
            raise InputError(f"session {kind}: {str(error).split('() ', 1)[-1]}") from None
    if "table_tilt_deg" in table:
        a, b = table["table_tilt_deg"]
        motion = dataclasses.replace(motion, table_tilt_deg=(float(a), float(b)))
    return motion


def _tupled(value: Any) -> Any:
    return tuple(_tupled(v) for v in value) if isinstance(value, list) else value


def _reject_unknown(values: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    for key in values:
        if key not in known:
            tables = ("clock", "environment", "accelerometer", "gyroscope") if where == "the file" else ()
            homes = [t for t in tables if key in {f.name for f in dataclasses.fields(_TABLES[t])}]
            hint = f" (it belongs in {' or '.join(f'[{t}]' for t in homes)})" if homes else meant(key, known)
            raise InputError(f"{where} has no key {key!r}{hint}; it knows {', '.join(known)}")


def _sensor(base: Any, table: Mapping[str, Any], name: str) -> Any:
    """The profile's sensor with fields of a table; in another unit its own ADC has the same steps and range."""
    values = table.get(name, {})
    made = _changed(base, values, name)
    if np.linalg.matrix_rank(np.asarray(made.S)) < 3:
        raise InputError(f"{name}: S has no inverse, so that an axis would read nothing: give each axis its scale")
    if made.unit is base.unit or "adc" in values:
        return made
    adc, (old, new) = base.adc, (np.abs(np.diag(np.asarray(one.S))).mean() for one in (base, made))
    factor = float(old / new)
    half, middle = 0.5 * factor * (adc.high - adc.low), -float(np.mean(np.linalg.solve(made.S, made.b)))
    scaled = dataclasses.replace(adc, lsb=factor * adc.lsb, low=middle - half, high=middle + half)
    return dataclasses.replace(made, adc=dataclasses.replace(scaled, dead_band=factor * adc.dead_band))


def _changed(base: Any, values: Mapping[str, Any], where: str) -> Any:
    """The dataclass ``base`` with some fields replaced by values of a table."""
    if not isinstance(values, Mapping):
        raise InputError(f"{where} must be a table, got {values!r}")
    return dataclasses.replace(base, **_fields(type(base), values, base, where))


def _made(cls: type[Any], values: Mapping[str, Any], where: str) -> Any:
    """A dataclass from a table; other fields have their defaults."""
    try:
        return cls(**_fields(cls, values, None, where))
    except TypeError as error:
        raise InputError(f"{where}: {str(error).split('() ', 1)[-1]}") from None


def _fields(cls: type[Any], values: Mapping[str, Any], base: Any, where: str) -> dict[str, Any]:
    _reject_unknown(values, tuple(f.name for f in dataclasses.fields(cls)), where)
    hints = typing.get_type_hints(cls)
    return {k: _value(hints[k], v, getattr(base, k, None), f"{where}.{k}") for k, v in values.items()}


def _value(hint: Any, value: Any, base: Any, where: str) -> Any:
    if dataclasses.is_dataclass(hint):
        return _changed(base, value, where) if base is not None else _made(typing.cast(Any, hint), value, where)
    if typing.get_origin(hint) is tuple:
        return _tuple_value(typing.get_args(hint), value, where)
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        try:
            return hint(value)
        except ValueError:
            raise InputError(f"{where} is one of {', '.join(m.value for m in hint)}, got {value!r}") from None
    if hint is float and isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    if hint in (bool, int, str) and type(value) is hint:
        return value
    raise InputError(f"{where} must be {getattr(hint, '__name__', hint)}, got {value!r}")


def _tuple_value(items: tuple[Any, ...], value: Any, where: str) -> Any:
    if len(items) == 2 and items[1] is Ellipsis:
        if not isinstance(value, list):
            raise InputError(f"{where} must be a list, got {value!r}")
        return tuple(_value(items[0], v, None, where) for v in value)
    if isinstance(value, (int, float)) and all(item is float for item in items):
        return tuple(float(value) for _ in items)
    if not isinstance(value, list) or len(value) != len(items):
        raise InputError(f"{where} must hold {len(items)} values (or one for all), got {value!r}")
    return tuple(_value(item, v, None, where) for item, v in zip(items, value, strict=True))


@cache
def _texts() -> dict[str, str]:
    folder = files("trihedron.simulate").joinpath("scenarios")
    return {Path(entry.name).stem: entry.read_text(encoding="utf-8") for entry in folder.iterdir()}


def list_scenarios() -> dict[str, str]:
    """Name and one sentence for each ready-made scenario."""
    return {name: str(parse_toml(text)["about"]) for name, text in sorted(_texts().items())}


def scenario_by_name(name: str) -> Scenario:
    """A ready-made scenario; raises ``InputError`` when no scenario has that name."""
    if name not in _texts():
        raise InputError(f"no scenario is called {name!r}; there are {', '.join(sorted(_texts()))}")
    return scenario_from_table(parse_toml(_texts()[name]), name)
