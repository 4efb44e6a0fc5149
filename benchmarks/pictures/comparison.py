"""Make the pictures of README.md and docs/claims.md: python -m benchmarks.pictures.comparison."""

from __future__ import annotations

from rich.progress import track

from benchmarks.pages import FIGURES
from rbimpedance.pictures import figures as plotting
from rbimpedance.simulation.scenarios import paper_comparison

FRONT_DOOR = (
    "paper's law, as sampled",
    "computed torque (Hogan)",
    "first-order, boundary layer",
    "both mended",
)


def main() -> None:
    """Run the comparison once and draw it twice."""
    scenarios = paper_comparison()
    results = {name: scenarios[name].simulate() for name in track(scenarios, "simulating")}
    plotting.save(plotting.comparison(results), FIGURES / "comparison.png")
    chosen = {name: results[name] for name in FRONT_DOOR}
    plotting.save(plotting.comparison(chosen), FIGURES / "readme.png")


if __name__ == "__main__":
    main()
