"""What faults do to a guarded loop, what an energy tank does at the port, a day of ticks, and kills of a long run.

    python -m benchmarks.control.reliability faults     [--robots panda ur5 kinova] [--write]
    python -m benchmarks.control.reliability passivity  [--write]
    python -m benchmarks.control.reliability day        [--hours 24] [--write]
    python -m benchmarks.control.reliability kill       [--times 50] [--write]

Each prints its table; `--write` puts it between its markers in docs/reliability.md. Everything is seeded. A torque that
is not finite or beyond the limits, a file that is not whole, or bytes that differ end the script with an error.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

from benchmarks.pages import DOCS, rewrite

from .day import day
from .faults import faults
from .guarded_arm import CENTERS
from .kills import kill
from .port import passivity


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("what", choices=("faults", "passivity", "day", "kill"))
    parser.add_argument("--robots", nargs="+", default=list(CENTERS), choices=CENTERS)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--times", type=int, default=50)
    parser.add_argument("--write", action="store_true", help="put the table into the page")
    given = parser.parse_args()
    measures: dict[str, Callable[[], str]] = {
        "faults": lambda: faults(given.robots),
        "passivity": passivity,
        "day": lambda: day(given.hours),
        "kill": lambda: kill(given.times),
    }
    made = measures[given.what]()
    print(made)
    if given.write:
        rewrite(DOCS / "reliability.md", {given.what: made})


if __name__ == "__main__":
    main()
