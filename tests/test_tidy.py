"""The check of committed text: words that this project once used in its own sense are named, with plain ones."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def tidy() -> ModuleType:
    found = importlib.util.spec_from_file_location("tidy", ROOT / ".ci" / "tidy.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


OURS = [
    ("The loop bears a lag of 2 ms.", "bears"),
    ("A difference of 1e-9 is borne.", "borne"),
    ("It mends the file.", "mends"),
    ("The controller is told tau_ext.", "told"),
    ("Two gains that nobody can tell apart.", "tell apart"),
    ("Pinocchio judges the result.", "judges"),
    ("Gains per joint that carry the uncertainty.", "Gains per joint that carry"),
    ("A joint that cannot be carried.", "cannot be carried"),
    ("It has no say in the dynamics.", "has no say"),
    ("What is left is the floor.", "What is left"),
    ("Seconds of the wall's clock.", "wall's clock"),
    ("The buffer has done its work.", "done its work"),
    ("A row, whatever comes of it.", "whatever comes"),
    ("Above 8 expect a no.", "a no"),
    ("Every yes is tested.", "Every yes"),
    ("The joint and the ways out.", "ways out"),
    ("A target that lets go in finite time.", "lets go"),
    ("The run goes on.", "goes on"),
    ("The surface stands still.", "stands still"),
    ("Equal to the bit.", "to the bit"),
    ("The file is written anew.", "anew"),
    ("The error that is asked for.", "asked for"),
    ("Gains put to plants.", "put to plants"),
]

PLAIN = [
    "The arm carries a payload of 2 kg on ball bearings.",
    "The law tolerates a lag of 2 ms and reports the remaining error.",
    "The controller measures tau_ext; telling is no word of ours.",
    "A no-op. Go on top of the stack. The answer is yes.",
    "The controller's model contains half of the payload.",
]


@pytest.mark.parametrize(("sentence", "ours"), OURS, ids=[ours for _, ours in OURS])
def test_word_of_our_own_is_named_with_line_and_plain_word(
    tidy: ModuleType, sentence: str, ours: str
) -> None:
    faults = list(tidy.wording(Path("docs/page.md"), f"# Title\n\n{sentence}\n"))
    assert [fault for fault in faults if fault.startswith(f'line 3 says "{ours}"; plain: ')]


def test_every_pattern_has_a_sentence_that_it_refuses(tidy: ModuleType) -> None:
    sentences = "\n".join(sentence for sentence, _ in OURS)
    assert [ours.pattern for ours in tidy._WORDS if not ours.search(sentences)] == []


@pytest.mark.parametrize("sentence", PLAIN)
def test_plain_sentence_is_accepted(tidy: ModuleType, sentence: str) -> None:
    assert list(tidy.wording(Path("docs/page.md"), sentence + "\n")) == []


def test_code_and_links_of_a_page_are_not_prose(tidy: ModuleType) -> None:
    page = (
        "See `told` and [here](#what-is-told).\n\n```python\nmended = told\n```\n\n(the-way-out)=\n"
    )
    assert list(tidy.wording(Path("docs/page.md"), page)) == []


def test_messages_docstrings_and_comments_of_a_module_are_prose_and_names_are_not(
    tidy: ModuleType,
) -> None:
    module = 'def told(x):\n    """It bears."""\n    return f"mend {told}"  # judged\n'
    faults = list(tidy.wording(Path("src/x.py"), module))
    assert [fault.split(";")[0] for fault in faults] == [
        'line 2 says "bears"',
        'line 3 says "mend"',
        'line 3 says "judged"',
    ]


def test_files_outside_of_pages_and_source_are_free(tidy: ModuleType) -> None:
    assert list(tidy.wording(Path("tests/test_x.py"), "# told\n")) == []
    assert list(tidy.wording(Path("CHANGELOG.md"), "It mends.\n")) == []
