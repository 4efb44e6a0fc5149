"""Tables of what a loop costs besides its time: start-up and memory."""

from __future__ import annotations

from rbimpedance.cli.timing import BACKENDS, RNEA

from . import startup, ticks
from .plan import Setting
from .report import RATIO, Line, Section


def start_up(setting: Setting) -> Section:
    """Imports, compilation and the first tick, each in new processes."""
    pinocchio, package = startup.import_times(setting.plan.imports)
    lines = [Line("import rbimpedance beyond pinocchio", {"time [s]": package})]
    lines.append(Line("import pinocchio", {"time [s]": pinocchio}))
    for k, backend in enumerate(BACKENDS):
        starts = startup.compile_times(setting.robot, backend)
        for kind, start in zip(("empty cache", "second process"), starts, strict=True):
            figures = {
                "time [s]": start.controller,
                "first tick [µs]": start.first,
                "median of the next [µs]": start.median,
                "longest of the next [µs]": start.longest,
                f"{RATIO} first / median": start.first / start.median,
            }
            lines.append(Line(f"controller and warm_up, {backend}, {kind}", figures))
        setting.on_tick(k + 1, len(BACKENDS))
    return Section(
        "start-up",
        "Start-up",
        "Every line in new processes; an empty cache is one without machine code. The first tick and "
        "those that follow come 1 ms apart after `warm_up`.",
        tuple(lines),
    )


def memory(setting: Setting) -> Section:
    """What ticks allocate, and what stays."""
    lines, count = [], setting.plan.memory
    for name, made in ticks.of_arm(setting.arm).items():
        if name == RNEA:
            continue
        least, most = startup.allocation(made)
        grown, blocks = startup.growth(made, count, setting.on_tick)
        figures = {
            "a tick, least [bytes]": float(least),
            "a tick, most [bytes]": float(most),
            "grown by [kB]": grown / 1e3,
            "blocks more": float(blocks),
        }
        lines.append(Line(name, figures))
    return Section(
        "memory",
        f"Memory: {setting.robot}",
        f"What one tick allocates, seen by `tracemalloc` over 200 ticks, and how much the process grows over {count} "
        "ticks (resident memory, and blocks that Python's allocator holds).",
        tuple(lines),
    )
