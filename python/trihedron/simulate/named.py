"""Ready-made scenarios by name: files of this package, as a user writes them."""

from functools import cache
from importlib.resources import files
from pathlib import Path

from trihedron.documents import parse_toml
from trihedron.errors import InputError
from trihedron.simulate.scenario import Scenario
from trihedron.simulate.scenario_file import scenario_from_table


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
