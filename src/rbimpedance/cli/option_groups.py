"""Commands that take groups of options: one dataclass a group, one option a field."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, get_type_hints


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command for Typer, which has the fields of its dataclass parameters as parameters.

    Args:
        command: A function whose parameters are dataclasses with annotated fields, or what Typer takes.
    """
    parameters = signature(command, eval_str=True).parameters.values()
    groups = {p.name: p.annotation for p in parameters if isinstance(p.annotation, type)}
    groups = {name: kind for name, kind in groups.items() if is_dataclass(kind)}

    @wraps(command)
    def run(**given: Any) -> None:
        for name, group in groups.items():
            values = {field.name: given.pop(field.name) for field in fields(group)}
            given[name] = group(**values)
        command(**given)

    spread: list[Parameter] = []
    for parameter in parameters:
        group = groups.get(parameter.name)
        spread += [parameter.replace(kind=Parameter.KEYWORD_ONLY)] if group is None else _of(group)
    run.__signature__ = Signature(spread)  # type: ignore[attr-defined]
    return run


def _of(group: type[Any]) -> Iterator[Parameter]:
    hints = get_type_hints(group, include_extras=True)
    for field in fields(group):
        yield Parameter(
            field.name,
            Parameter.KEYWORD_ONLY,
            default=_default(field),
            annotation=hints[field.name],
        )


def _default(field: Field[Any]) -> Any:
    return Parameter.empty if field.default is MISSING else field.default
