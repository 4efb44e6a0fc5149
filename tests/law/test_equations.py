"""Every equation of the paper that the theory page explains is computed at one place in the code, which names it."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import rbimpedance

SOURCES = Path(rbimpedance.__file__).parent
THEORY = Path(__file__).parents[2] / "docs" / "theory.md"

MARK = re.compile(r"paper, eqs?\. ([0-9]+(?:(?:, | and | to )[0-9]+)*)")
"""Where an equation is computed, docstring or comment say "paper, eq. N"; elsewhere it is "eq. (N)"."""
NOT_IN_THE_PACKAGE = {20, 21}  # the two-link arm: urdf/two_link.urdf, and tests/oracles/two_link.py


def _numbers(words: str) -> set[int]:
    first, _, last = words.partition(" to ")
    if last:
        return set(range(int(first), int(last) + 1))
    return {int(number) for number in re.findall("[0-9]+", words)}


def _places() -> dict[int, list[str]]:
    places: dict[int, list[str]] = defaultdict(list)
    for path in sorted(SOURCES.rglob("*.py")):
        for mark in MARK.finditer(path.read_text(encoding="utf-8")):
            for number in _numbers(mark[1]):
                places[number].append(str(path.relative_to(SOURCES)))
    return places


def _explained() -> set[int]:
    """The numbers of the page: tags of formulas, and those in brackets after a paragraph's words."""
    text = THEORY.read_text(encoding="utf-8")
    found = re.findall(r"\\tag\{([0-9, ]+)\}|(?<=[ |])\(([0-9]{1,2})\)", text)
    return {number for pair in found for words in pair for number in _numbers(words)}


def test_equations_are_computed_at_one_place_each() -> None:
    places = _places()
    assert {number: where for number, where in places.items() if len(where) > 1} == {}
    assert _explained() - NOT_IN_THE_PACKAGE - set(places) == set()


def test_the_page_explains_the_law() -> None:
    assert set(range(1, 10)) <= _explained()


def test_the_equations_of_the_law_are_in_its_room() -> None:
    places = _places()
    own = {number for number in range(2, 10) if number != 4}  # (4) needs the arm's q_d (+) q_e
    assert {places[number][0].partition("/")[0] for number in own} == {"law"}
