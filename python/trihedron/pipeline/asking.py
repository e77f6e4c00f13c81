"""How a verb is asked in Python: plain arguments are checked before work, sentences name parameters, never flags."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable
from numbers import Integral, Real
from typing import Any, TypeVar

from trihedron.pipeline.wording import in_python, result_in_python

Verb = TypeVar("Verb", bound=Callable[..., Any])


class WrongTypeError(TypeError, ValueError):
    """An argument of a type that the verb does not take: which, what it is, what it should be."""


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
        given = signature.bind(*args, **kwargs)
        for name, value in given.arguments.items():
            _check(verb.__name__, name, value, str(signature.parameters[name].annotation))
        try:
            return result_in_python(verb(*args, **kwargs))
        except ValueError as error:
            said = in_python(str(error))
            if said == str(error):
                raise
            try:
                named = type(error)(said)
            except TypeError:
                named = ValueError(said)
            raise named from None

    return ask  # type: ignore[return-value]


def _check(verb: str, name: str, value: Any, annotation: str) -> None:
    kinds = {part.strip() for part in annotation.split("|")}
    if value is None and "None" in kinds:
        return
    kinds.discard("None")
    if kinds == {"float"} and (isinstance(value, bool) or not isinstance(value, Real)):
        raise WrongTypeError(f"{verb}: {name} is a number, not {_words(value)}.")
    if kinds == {"int"} and (isinstance(value, bool) or not isinstance(value, Integral)):
        raise WrongTypeError(f"{verb}: {name} is a whole number, not {_words(value)}.")
    if kinds == {"str"} and not isinstance(value, str):
        raise WrongTypeError(f"{verb}: {name} is a text, not {_words(value)}.")
    if kinds == {"bool"} and not isinstance(value, bool):
        raise WrongTypeError(f"{verb}: {name} is True or False, not {_words(value)}.")
    if kinds == {"str", "os.PathLike[str]"} and not isinstance(value, str | os.PathLike):
        raise WrongTypeError(f"{verb}: {name} is the name of a file, not {_words(value)}.")
    if annotation.startswith("Sequence[") and (isinstance(value, str | bytes | Real) or not hasattr(value, "__len__")):
        raise WrongTypeError(f"{verb}: {name} is a list of numbers, not {_words(value)}.")


def _words(value: Any) -> str:
    text = repr(value)
    return f"{type(value).__name__} {text[:40]}" if len(text) <= 60 else f"a {type(value).__name__}"
