"""Near names for error messages."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def suggest(name: str, known: Iterable[str]) -> str:
    """Return "; did you mean ...?" for near names, else "; there are: ..." (the first twelve)."""
    names = list(known)
    folded = {candidate.lower(): candidate for candidate in names}
    near = difflib.get_close_matches(name.lower(), folded, n=4, cutoff=0.6)
    if near:
        return "; did you mean " + ", ".join(f"'{folded[candidate]}'" for candidate in near) + "?"
    shown = ", ".join(f"'{candidate}'" for candidate in names[:12])
    return f"; there are: {shown}{', ...' if len(names) > 12 else ''}"
