"""Expand one xacro file: the program of the process that `xacro_expansion` starts, with one JSON argument."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any


class Arguments(dict[str, str]):
    """The values of a xacro file's arguments, which records the names that the file uses."""

    def __init__(self, given: dict[str, str]) -> None:
        super().__init__(given)
        self.asked: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked.add(name)
        return super().__getitem__(name)


def main(task: dict[str, Any]) -> None:
    """Write the expanded text to standard output; leave with a message where that fails.

    Args:
        task: `file`, its `arguments`, those that it must `use`, the `folders` and `packages` that $(find) sees, and
            the interpreter's `path`.
    """
    sys.path[:] = task["path"]
    import xacro  # noqa: PLC0415  (from that path)
    from xacro import substitution_args  # noqa: PLC0415

    packages = _packages(task)

    def find(name: str) -> str:
        place = packages.find(name)
        if place is None:
            raise substitution_args.SubstitutionException(
                f"the ROS package '{name}' is not found; name the folder that holds it with package_dirs= "
                "(--package-dir)"
            )
        return str(place)

    substitution_args._eval_find = find
    substitution_args._eval_dict["find"] = find
    arguments = Arguments(task["arguments"])
    try:
        text = xacro.process_file(task["file"], mappings=arguments).toxml()
    except BaseException as error:
        sys.exit(_reason(error, _unused(task["use"], arguments.asked) if arguments.asked else []))
    for fault in _unused(task["use"], arguments.asked):
        sys.exit(fault)
    sys.stdout.buffer.write(text.encode())


def _reason(error: BaseException, unused: list[str]) -> str:
    """What went wrong, without the classes of xacro around it."""
    inner = error
    while isinstance(getattr(inner, "exc", None), BaseException):
        inner = inner.exc  # type: ignore[attr-defined]
    kind, reason = type(inner).__name__, str(error)
    if kind == "SubstitutionException":  # a package: arguments of the file come later
        return str(inner)
    if kind == "ArgException":
        option = f'xacro_args={{"{inner}": ...}} (--xacro-arg {inner}:=VALUE)'
        return "; ".join([f"its argument '{inner}' has no default; give it with {option}", *unused])
    return "; ".join([f"{kind}: {reason}", *unused])


def _unused(wanted: list[str], asked: set[str]) -> list[str]:
    """Report the user's arguments that the file does not have."""
    there = ", ".join(sorted(asked)) or "none"
    return [
        f"the file has no argument '{name}' (it has: {there})"
        for name in wanted
        if name not in asked
    ]


def _packages(task: dict[str, Any]) -> Any:
    """`Packages` of the file next to this one, without the library that they belong to."""
    spec = importlib.util.spec_from_file_location(
        "packages", Path(__file__).with_name("packages.py")
    )
    if spec is None or spec.loader is None:
        sys.exit("packages.py is missing next to xacro_worker.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    folders = [Path(folder) for folder in task["folders"]]
    return module.Packages(folders, Path(task["file"]), task["packages"])


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
