"""Studies by the words of a command line: a name of this library, or an object of someone's file or module."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from .._common.suggestions import suggest
from .definition import Study
from .folder import StudyError

NAMED = {name: f"rbimpedance.study.standard:{name.upper()}" for name in ("standard", "linear")}
"""Where the library's own studies are."""


def find_study(words: str) -> Study:
    """Return a study by its name, or by where it is. The code that is named is run.

    Args:
        words: "standard", "linear"; or FILE.py:NAME, or MODULE:NAME, where NAME is a `Study` of that file or module.

    Raises:
        StudyError: There is none.
    """
    place, colon, name = NAMED.get(words, words).rpartition(":")
    if not colon:
        known = suggest(words, NAMED)
        raise StudyError(f"no study '{words}': a name, FILE.py:NAME or MODULE:NAME{known}")
    module = _from_file(Path(place)) if place.endswith(".py") else _module(place)
    found = getattr(module, name, None)
    if not isinstance(found, Study):
        what = "nothing" if found is None else f"a {type(found).__name__}"
        raise StudyError(f"'{place}' has {what} of the name '{name}', not a Study")
    return found


def _module(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise StudyError(f"no module '{error.name}', which '{name}' is or needs") from error


def _from_file(path: Path) -> ModuleType:
    """Run a file as a module; its functions then travel to workers with their code."""
    name = f"study_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise StudyError(f"no file '{path}'")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    try:
        import cloudpickle  # noqa: PLC0415 (comes with Dask)
    except ImportError:
        return module
    cloudpickle.register_pickle_by_value(module)
    return module
