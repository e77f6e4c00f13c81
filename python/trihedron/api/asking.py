"""How a verb is asked in Python: plain arguments are checked before work, sentences name parameters, never flags."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeVar

from trihedron.api.arguments import settled
from trihedron.records.checked import WrongTypeError
from trihedron.report.in_python import in_python, result_in_python

__all__ = ["WrongTypeError", "asked_in_python"]

Verb = TypeVar("Verb", bound=Callable[..., Any])


def asked_in_python(verb: Verb) -> Verb:
    """The verb with its plain arguments checked and its sentences in Python's words.

    Raises
    ------
    WrongTypeError
        (a ``TypeError`` and a ``ValueError``) when a number, a text or a switch is something else.
    """
    signature = inspect.signature(verb)

    @functools.wraps(verb)
    def ask(*args: Any, **kwargs: Any) -> Any:
        try:
            given = signature.bind(*args, **kwargs)
        except TypeError as error:
            raise WrongTypeError(f"{verb.__name__}: {error}; see help(trihedron.{verb.__name__}).") from None
        for name, value in given.arguments.items():
            if signature.parameters[name].kind is inspect.Parameter.VAR_KEYWORD:
                given.arguments[name] = _options(verb.__name__, value)
            else:
                annotation = str(signature.parameters[name].annotation)
                given.arguments[name] = settled(verb.__name__, name, value, annotation)
        try:
            return result_in_python(verb(*given.args, **given.kwargs))
        except ValueError as error:
            said = in_python(str(error))
            if said == str(error):
                raise
            try:
                named = type(error)(said)
            except TypeError:
                named = ValueError(said)
            raise named from None

    # Pickle finds it under the name that people call.
    ask.__module__, ask.__qualname__ = "trihedron", verb.__name__
    return ask  # type: ignore[return-value]


def _options(verb: str, options: dict[str, Any]) -> dict[str, Any]:
    """What is handed on to :func:`trihedron.read`."""
    known = inspect.signature(import_module("trihedron.api.reading").read).parameters
    for name in options:
        if name not in known or name == "path":
            raise WrongTypeError(f"{verb}: trihedron.read has no option {name}; see help(trihedron.read).")
    return {name: settled(verb, name, value, str(known[name].annotation)) for name, value in options.items()}
