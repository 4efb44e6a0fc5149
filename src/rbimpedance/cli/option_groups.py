"""Commands that take groups of options: one dataclass a group, one option a field; a field may be a group itself."""

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
    groups = {p.name: p.annotation for p in parameters if _is_group(p.annotation)}

    @wraps(command)
    def run(**given: Any) -> None:
        made = {name: _made(group, given) for name, group in groups.items()}
        command(**made, **given)

    spread: list[Parameter] = []
    for parameter in parameters:
        group = groups.get(parameter.name)
        spread += [parameter.replace(kind=Parameter.KEYWORD_ONLY)] if group is None else _of(group)
    run.__signature__ = Signature(spread)  # type: ignore[attr-defined]
    return run


def _is_group(kind: Any) -> bool:
    return isinstance(kind, type) and is_dataclass(kind)


def _made(group: type[Any], given: dict[str, Any]) -> Any:
    """A group with its values, which are taken out of those given."""
    hints = get_type_hints(group)
    return group(
        **{
            field.name: _made(kind, given) if _is_group(kind) else given.pop(field.name)
            for field in fields(group)
            for kind in (hints[field.name],)
        }
    )


def _of(group: type[Any]) -> Iterator[Parameter]:
    hints = get_type_hints(group, include_extras=True)
    for field in fields(group):
        name, kind = field.name, hints[field.name]
        if _is_group(kind):
            yield from _of(kind)
        else:
            yield Parameter(name, Parameter.KEYWORD_ONLY, default=_default(field), annotation=kind)


def _default(field: Field[Any]) -> Any:
    return Parameter.empty if field.default is MISSING else field.default
