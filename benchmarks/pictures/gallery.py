"""Every figure of the library as PNG and PDF, a contact sheet of them and of the docs', and an animation in one file.

python -m benchmarks.pictures.gallery [FOLDER]
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.image import imread

import rbimpedance as rbi
from benchmarks import arms, pages
from rbimpedance.pictures import figures as plotting
from rbimpedance.simulation import scenarios


def left_after_two_seconds(payload: float, k1: float) -> float:
    """Largest abs(e1) in the half second after 2 s, with a payload that the controller does not know [rad]."""
    scenario = scenarios.paper(
        surface="fast-terminal", scheme="matched", known="full", duration=2.5
    )
    law = rbi.SuperTwisting(k1=k1, k2=k1**2 / 5.0)
    known = scenario.controller
    assert isinstance(known, rbi.ImpedanceController)
    controller = rbi.ImpedanceController(
        known.arm, rbi.Impedance(1.0, 10.0, 20.0), known.surface, law, dt=known.dt
    )
    changed = replace(scenario, controller=controller, plant=scenario.plant.with_payload(payload))
    try:
        return float(changed.simulate().metrics(after=2.0)["e1_max"].max())
    except rbi.DivergenceError:
        return float("inf")


def figures() -> Mapping[str, Figure]:
    """All figures by name, of the paper's arm and its variations."""
    published = scenarios.paper(duration=4.0).simulate()
    scenario = scenarios.paper(
        surface="fast-terminal", scheme="matched", known="full", duration=4.0
    )
    corrected = scenario.simulate()
    arm = rbi.load_robot("two_link")
    surface = scenarios.paper_surface("fast-terminal")
    certificate = rbi.certify(
        8.0, 10.0, 0.5, s0=[4.0, 4.0], disturbance0=0.0, surface=surface, e0=0.7
    )
    loaded = replace(scenario, plant=scenario.plant.with_payload(0.3)).simulate()
    observed = rbi.estimate_disturbance(loaded, arm, rbi.SuperTwisting(60.0, 200.0))
    at_tool = pushed_tool()
    payloads, gains = [0.0, 1.0, 2.0, 4.0], [5.0, 10.0, 20.0, 40.0]
    errors = [[left_after_two_seconds(m, k1) for k1 in gains] for m in payloads]
    return {
        "tracking_errors": plotting.tracking_errors(published),
        "impedance_error": plotting.impedance_error(published),
        "torques": plotting.torques(published),
        "comparison": plotting.comparison({"as published": published, "corrected": corrected}),
        "error_sizes": plotting.error_sizes(
            {"as published": (published.t, published.e1), "corrected": (corrected.t, corrected.e1)}
        ),
        "convergence": plotting.convergence(corrected, certificate),
        "torque_margins": plotting.torque_margins(corrected, 60.0),
        "chatter_spectrum": plotting.chatter_spectrum(
            {"published": published, "corrected": corrected}
        ),
        "phase_plane": plotting.phase_plane(corrected, surface),
        "robustness_map": plotting.robustness_map(
            payloads, gains, errors, labels=("payload [kg]", "gain k1", "abs(e1) [rad]")
        ),
        "interaction_energy": plotting.interaction_energy(
            corrected, rbi.energy_balance(corrected, arm)
        ),
        "disturbance": plotting.disturbance(loaded, observed),
        "tool_errors": plotting.tool_errors(at_tool),
        "tool_path": plotting.tool_path(at_tool),
    }


def pushed_tool() -> rbi.SimulationResult:
    """A tool that is soft in z on a line, pushed down, with 1 kg that its controller does not know of."""
    arm = arms.load("ur5", armature=0.1)
    target = rbi.CartesianImpedance((3.0, 0.15), [1000.0, 1000.0, 200.0, 30.0, 30.0, 30.0])
    q0 = [0.0, -1.2, 1.6, -1.9, -1.57, 0.3]
    start = rbi.Pose(*arm.frame_placement(q0))
    line = rbi.trajectories.cartesian.line(start, [0.0, 0.2, 0.0], duration=1.0)
    return rbi.simulate(
        rbi.CartesianController(arm, target),
        arm.with_payload(1.0),
        line,
        environment=[0.0, 0.0, -10.0, 0.0, 0.0, 0.0],
        q0=q0,
        duration=1.5,
    )


def push(page: Path) -> Path:
    """Animate a panda with 1.5 kg that its controller does not know of, pushed and turned at the hand."""
    arm = arms.load("panda", armature=0.1)
    controller = arms.law(arm, rbi.SuperTwisting(k1=50.0, k2=500.0))
    q0 = [0.0, -0.6, 0.0, -2.2, 0.0, 1.7, 0.8]
    hold = rbi.trajectories.hold(arm, q0)
    hand = rbi.interaction.Push([0, 20, 0, 0, 0, 4], start=0.5, duration=1.0)
    result = rbi.simulate(
        controller, arm.with_payload(1.5), hold, environment=hand, q0=q0, duration=3.0
    )
    return result.animate(environment=hand).save_html(page)


def contact_sheet(paths: list[Path]) -> Figure:
    """All pictures on one page, in one scale."""
    images = {path.stem: imread(path) for path in paths}
    tallest, widest = (max(image.shape[i] for image in images.values()) for i in (0, 1))
    rows = -(-len(paths) // 3)
    sheet = Figure(figsize=(15.0, 5.0 * tallest / widest * rows), layout="constrained")
    sheet.subplots(rows, 3)
    for axes in sheet.axes:
        axes.axis("off")
    for axes, (name, image) in zip(sheet.axes, images.items(), strict=False):
        axes.imshow(image)
        axes.set(xlim=(0, widest), ylim=(tallest, 0))
        axes.set_title(name, fontsize=8, loc="left")
    return sheet


def main() -> None:
    """Write them."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/gallery")
    folder.mkdir(parents=True, exist_ok=True)
    drawn = figures()
    for name, figure in drawn.items():
        plotting.save(figure, folder / f"{name}.pdf")
    pictures = [plotting.save(figure, folder / f"{name}.png") for name, figure in drawn.items()]
    sheet = contact_sheet([*pictures, *sorted(pages.FIGURES.glob("*.png"))])
    print(plotting.save(sheet, folder / "contact_sheet.png"))
    print(push(folder / "push.html"))


if __name__ == "__main__":
    main()
