"""Refuse files that should not be committed: too large, untidy text, words of our own, notebooks with outputs.

Takes file names; without any, all files that git tracks.
"""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

MAX_BYTES = 500_000
BINARY = {".png", ".npz", ".gif", ".pdf"}

PLAIN_WORDS = {
    r"bears?|borne": "tolerates, is robust to",
    r"mend(?:s|ed|ing)?": "fix, correction, repair",
    r"told|tells|tell (?:whether|(?:\w+ )?apart)": "given, measured, reports; distinguish",
    r"judg(?:es?|ed|ing|e?ments?)": "check, compare, reference",
    r"(?:gains|scheme|margin|law|loop)[^.:;]{0,30} carr(?:y|ies|ied)": "tolerates",
    r"cannot (?:be carried|carry)|carr(?:y|ies) what": "tolerates; infeasible; does not support",
    r"ha(?:s|ve) no say": "does not affect",
    r"what (?:remains|is left)": "the remaining error, the rest",
    r"wall's clock": "wall-clock",
    r"done its work": "name the state: buffer reused, finished",
    r"whatever (?:comes|came|becomes)": "name the cases: failures included",
    r"(?:a|the|every|each) yes|a no(?!-)|answers? (?:is|was) no": "feasible, infeasible",
    r"ways? out": "remedy",
    r"lets? go": "releases, release",
    r"go(?:es)? on(?! top)|went on": "continues",
    r"stands? (?:still|beside|between|for itself)": "is fixed, is constant; is next to, is between",
    r"to the (?:bit|letter)": "bitwise equal; exactly",
    r"anew": "again",
    r"asked for": "requested, required, demanded",
    r"put to (?:plants|the test)": "validated on, tested",
}
"""Words that this project once used in a sense of its own (patterns), and the field's words for them."""

PENDING: frozenset[str] = frozenset()
"""Files whose words are still to be replaced; nothing is added here."""

_WORDS = {
    re.compile(rf"\b(?:{ours})\b", re.IGNORECASE): plain for ours, plain in PLAIN_WORDS.items()
}


def _prose(path: Path, text: str) -> Iterator[tuple[int, str]]:
    """Lines with prose in them: of a page all but code, of a module its docstrings, messages and comments."""
    if path.suffix == ".md":
        fenced = False
        for i, line in enumerate(text.splitlines(), 1):
            fenced ^= line.startswith("```")
            if not fenced:
                yield i, re.sub(r"`[^`]*`|\]\([^)]*\)|<!--.*?-->|^\([\w-]+\)=$", "", line)
        return
    kinds = {tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", -1)}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in kinds:
            for i, line in enumerate(token.string.splitlines(), token.start[0]):
                yield i, re.sub(r"`[^`]*`|\{[^}]*\}", "", line)


def wording(path: Path, text: str) -> Iterator[str]:
    """Name the words of `PLAIN_WORDS` in README, pages and modules, with the plain ones."""
    is_page = path.suffix == ".md" and (path.name == "README.md" or "docs" in path.parts)
    if not is_page and not (path.suffix == ".py" and "src" in path.parts):
        return
    if path.as_posix() in PENDING:
        return
    for i, line in _prose(path, text):
        for ours, plain in _WORDS.items():
            for found in ours.finditer(line):
                yield f'line {i} says "{found[0]}"; plain: {plain}'


def faults(path: Path) -> Iterator[str]:
    """Say what is wrong with one file."""
    content = path.read_bytes()
    if len(content) > MAX_BYTES:
        yield f"{len(content)} bytes, more than {MAX_BYTES}"
    if path.suffix in BINARY or not content:
        return
    if not content.endswith(b"\n") or content.endswith(b"\n\n"):
        yield "does not end with exactly one newline"
    if b"\r" in content:
        yield "has carriage returns"
    for i, line in enumerate(content.splitlines(), 1):
        if line != line.rstrip():
            yield f"line {i} ends in white space"
    if path.suffix == ".ipynb" and any(c.get("outputs") for c in json.loads(content)["cells"]):
        yield "is a notebook with outputs; clear them"
    yield from wording(path, content.decode(errors="replace"))


def main(names: list[str]) -> int:
    """Print every fault; return 1 if there is one."""
    if not names:
        listing = subprocess.run(["git", "ls-files", "-z"], capture_output=True, check=True)
        names = listing.stdout.decode().split("\0")[:-1]
    found = [f"{name}: {fault}" for name in names for fault in faults(Path(name))]
    print("\n".join(found), end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
