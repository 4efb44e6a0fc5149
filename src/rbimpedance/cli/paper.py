"""The command `rbimpedance paper`."""

from __future__ import annotations

from ..exceptions import DivergenceError
from ..simulation.result import SimulationResult
from ..simulation.scenarios import paper as paper_scenario
from ..simulation.scenarios import paper_comparison
from .option_groups import with_options
from .options import Duration, KnowledgeOptions, OutputOptions, Period, SchemeName, Surface
from .recording import draw, prepare, record, say_written
from .run_tables import (
    LEGEND,
    comparison_figures,
    comparison_table,
    result_figures,
    result_tables,
)
from .terminal import explain, print_json, print_table, progress, say

_FIGURES = {
    "fig2_errors": "tracking_errors",
    "fig3_impedance_error": "impedance_error",
    "fig4_torque": "torques",
}

_FORMATS = ("png", "pdf")
_BEST = "both corrected"


@with_options
def paper(
    knowledge: KnowledgeOptions,
    output: OutputOptions,
    surface: Surface = "power",
    scheme: SchemeName = "explicit",
    dt: Period = 1e-3,
    duration: Duration = 10.0,
) -> None:
    """Reproduce section 4 of the paper: figures 2 to 4, the data, and each correction and baseline beside it.

    Takes some fifteen seconds, the first time on a machine a minute more.
    """
    model = knowledge.knowledge("inertia")
    prepare(output.out)
    scenario = paper_scenario(known=model, surface=surface, scheme=scheme, dt=dt, duration=duration)
    result = record(
        lambda on_tick: scenario.simulate(on_tick=on_tick), "paper", "simulating two_link", output
    )
    files = [*draw(result, _FIGURES, output.out, _FORMATS), output.out / "paper.npz"]
    compared = _compare(dt, duration, quiet=output.silent)
    first, *_ = compared
    for stem, names in {
        "corrections": [first, *(name for name in compared if "corrected" in name)],
        "baselines": [name for name in compared if "corrected" not in name or name == _BEST],
    }.items():
        shown = {name: compared[name] for name in names}
        files += draw(shown, {stem: "comparison"}, output.out, _FORMATS)
    title = f"two_link, {model} model, {surface} surface, {scheme} scheme, dt = {dt:g} s"
    if output.as_json:
        said = {"title": title, "joints": result.joint_names, "metrics": result_figures(result)}
        print_json(said | {"comparison": comparison_figures(compared)})
        return
    if not output.quiet:
        for table in result_tables(title, result):
            print_table(table)
        words = "The same with each correction, and the baselines; inertia known"
        print_table(comparison_table(words, compared))
        explain(LEGEND)
    say_written(files)


def _compare(dt: float, duration: float, *, quiet: bool) -> dict[str, SimulationResult]:
    """Run every law of `paper_comparison`; one that diverges is compared by what it did until then."""
    results: dict[str, SimulationResult] = {}
    scenarios = paper_comparison(dt=dt, duration=duration)
    if not quiet:
        say(f"{len(scenarios)} more runs: each correction, and the baselines")
    for i, (name, scenario) in enumerate(scenarios.items(), 1):
        with progress(f"{i} of {len(scenarios)}, {name}", quiet=quiet) as on_tick:
            try:
                results[name] = scenario.simulate(on_tick=on_tick)
            except DivergenceError as error:
                results[f"{name} (diverged)"] = error.result
    return results
