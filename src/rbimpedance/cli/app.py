"""The command line: `rbimpedance paper`, `run`, `tune`, `inspect`, `view`, `bench` and `study`.

Exit codes: 0 done, 1 the run failed (it diverged), 2 bad input, 130 a study was stopped by Ctrl-C.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import typer
from matplotlib.figure import Figure

from .. import __version__
from .._common.arrays import Array
from .._common.files import remove_parts
from ..control.controller import ImpedanceController
from ..exceptions import DivergenceError, ParameterError, RBImpedanceError
from ..interaction import FrameWrench
from ..law.impedance import Impedance
from ..law.super_twisting import Scheme, SuperTwisting
from ..pictures import figures as plotting
from ..robot.arm_model import ArmModel
from ..robot.knowledge import as_knowledge
from ..robot.load import load_robot
from ..robot.loading.encoding import decoded
from ..robot.loading.strict_xml import MAX_CHARACTERS
from ..simulation.checkpoint import Checkpoint
from ..simulation.plants.integrators import Integrator
from ..simulation.result import SimulationResult
from ..simulation.scenarios import Scenario, SurfaceName, paper, paper_comparison, paper_surface
from ..trajectories import cosine
from ..tuning import GainProposal, Uncertainty, propose_gains
from ..tuning.gains_file import load_gains, proposal_data, save_gains
from .bench import bench
from .run_tables import comparison_figures, comparison_table, result_figures, result_table
from .study import study
from .terminal import number, print_json, print_table, progress, stderr, stdout, table
from .tune_tables import case_names, gains_table, torque_table, worst_table

if TYPE_CHECKING:
    from ..pictures.viewer import Viewer

app = typer.Typer(
    help="Robust impedance control of any URDF arm.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Robot = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="URDF or xacro path, bundled name (two_link), example-robot-data or robot_descriptions "
        "name, or - for URDF text on stdin.",
    ),
]
Lock = Annotated[
    list[str] | None, typer.Option("--lock", metavar="JOINT", help="Freeze a joint; repeatable.")
]
ToolFrame = Annotated[
    str | None, typer.Option("--tool-frame", metavar="FRAME", help="Default: the deepest leaf.")
]
Armature = Annotated[
    str | None,
    typer.Option("--armature", metavar="A[,A...]", help="Reflected rotor inertia in kg m^2."),
]
Gravity = Annotated[
    str | None, typer.Option("--gravity", metavar="X,Y,Z", help="Gravity in world axes in m/s^2.")
]
Massless = Annotated[
    bool,
    typer.Option("--massless", help="Accept links without mass: no gravity is known there."),
]
PackageDir = Annotated[
    list[Path] | None,
    typer.Option("--package-dir", metavar="DIR", help="Where package:// resolves; repeatable."),
]
XacroArg = Annotated[
    list[str] | None,
    typer.Option(
        "--xacro-arg", metavar="NAME:=VALUE", help="Argument of a xacro file; repeatable."
    ),
]
Repair = Annotated[
    bool,
    typer.Option("--repair", help="Mend what has one obvious mend in the description, and say so."),
]
Known = Annotated[
    Literal["full", "inertia", "mass"],
    typer.Option("--model", "--known", help="What the controller knows; mass: old for inertia."),
]
Surface = Annotated[SurfaceName, typer.Option("--surface", help="Sliding surface.")]
SchemeName = Annotated[Scheme, typer.Option("--scheme", help="Discretisation of the law.")]
Period = Annotated[float, typer.Option("--dt", metavar="S", help="Control period in s.")]
Duration = Annotated[float, typer.Option("--duration", metavar="S", help="Length of the run in s.")]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")]
Json = Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress bar and no table.")]
Html = Annotated[
    Path | None,
    typer.Option("--html", metavar="FILE", help="Write the animation as one HTML file."),
]


@app.command(
    name="paper",
    epilog="Example: rbimpedance paper --surface fast-terminal --scheme matched --out out",
)
def paper_command(
    known: Known = "inertia",
    surface: Surface = "power",
    scheme: SchemeName = "explicit",
    dt: Period = 1e-3,
    duration: Duration = 10.0,
    out: Out = Path("out"),
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Reproduce section 4 of the paper: figures 2 to 4, the data, and every mend and baseline beside it."""
    scenario = paper(
        known=as_knowledge(known), surface=surface, scheme=scheme, dt=dt, duration=duration
    )
    figures = {
        "fig2_errors": plotting.tracking_errors,
        "fig3_impedance_error": plotting.impedance_error,
        "fig4_torque": plotting.torques,
    }
    result, files = _simulate(scenario, out, "paper", figures, quiet=quiet or as_json)
    compared = _compare(dt, duration, quiet=quiet or as_json)
    files.append(plotting.save(plotting.comparison(compared), out / "comparison.png"))
    title = f"two_link, {known} model, {surface} surface, {scheme} scheme, dt = {dt:g} s"
    if as_json:
        said = {"title": title, "joints": result.joint_names, "metrics": result_figures(result)}
        print_json(said | {"comparison": comparison_figures(compared)})
        return
    if not quiet:
        print_table(result_table(title, result))
        print_table(
            comparison_table("The same with each mend, and the baselines; inertia known", compared)
        )
    _say_written(files)


@app.command(epilog="Example: rbimpedance run panda --payload 2 --duration 5 --out out/")
def run(
    robot: Robot,
    payload: Annotated[
        float,
        typer.Option("--payload", metavar="KG", help="At the tool, unknown to the controller."),
    ] = 0.0,
    wrench: Annotated[
        str | None,
        typer.Option("--wrench", metavar="FX,FY,FZ", help="Force on the tool in world axes, in N."),
    ] = None,
    amplitude: Annotated[
        float, typer.Option("--amplitude", help="Of the cosine reference, rad or m.")
    ] = 0.2,
    period: Annotated[float, typer.Option("--period", help="Of the cosine reference in s.")] = 6.0,
    mass: Annotated[str, typer.Option("--mass", metavar="M[,M...]", help="M_d.")] = "1",
    damping: Annotated[str, typer.Option("--damping", metavar="D[,D...]", help="D_d.")] = "10",
    stiffness: Annotated[str, typer.Option("--stiffness", metavar="K[,K...]", help="K_d.")] = "20",
    k1: Annotated[str, typer.Option("--k1", metavar="K[,K...]", help="Gain k1.")] = "8",
    k2: Annotated[str, typer.Option("--k2", metavar="K[,K...]", help="Gain k2.")] = "10",
    surface: Surface = "fast-terminal",
    scheme: SchemeName = "matched",
    known: Known = "full",
    gains: Annotated[
        Path | None,
        typer.Option(
            "--gains",
            metavar="FILE",
            help="What tune wrote: replaces k1, k2, surface, scheme and dt.",
        ),
    ] = None,
    dt: Period = 1e-3,
    duration: Duration = 5.0,
    substeps: Annotated[int, typer.Option("--substeps", help="Physics steps per period.")] = 4,
    html: Html = None,
    integrator: Annotated[Integrator, typer.Option("--integrator")] = "semi-implicit",
    lock: Lock = None,
    tool_frame: ToolFrame = None,
    armature: Armature = None,
    gravity: Gravity = None,
    massless: Massless = False,
    package_dir: PackageDir = None,
    xacro_arg: XacroArg = None,
    repair: Repair = False,
    out: Out = Path("out"),
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where a killed run of this command was.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Simulate the controller on any robot, which follows a cosine about its neutral configuration."""
    arm = _load(
        robot,
        lock,
        tool_frame,
        armature,
        gravity,
        package_dir,
        massless=massless,
        xacro_arg=xacro_arg,
        repair=repair,
    )
    target = Impedance(
        mass=_numbers("--mass", mass),
        damping=_numbers("--damping", damping),
        stiffness=_numbers("--stiffness", stiffness),
    )
    if gains is not None:
        controller = load_gains(gains).controller(arm, target)
    else:
        controller = ImpedanceController(
            arm,
            impedance=target,
            surface=paper_surface(surface),
            reaching=SuperTwisting(_numbers("--k1", k1), _numbers("--k2", k2), scheme),
            dt=dt,
            model=as_knowledge(known),
        )
    force = np.zeros(3) if wrench is None else _numbers("--wrench", wrench, 3)
    if html is not None:
        html.parent.mkdir(parents=True, exist_ok=True)  # now, not when the run is over
    scenario = Scenario(
        controller=controller,
        plant=arm.with_payload(payload) if payload else arm,
        trajectory=cosine(arm, amplitude=amplitude, period=period),
        environment=FrameWrench(np.concatenate([force, np.zeros(3)])),
        q0=arm.neutral,
        duration=duration,
        substeps=substeps,
        integrator=integrator,
    )
    figures = {
        "errors": plotting.tracking_errors,
        "impedance_error": plotting.impedance_error,
        "torque": plotting.torques,
    }
    label = f"cosine {amplitude!r} {period!r}, force {force.tolist()}"
    checkpoint = Checkpoint(out / "result.checkpoint", label, resume=resume)
    result, files = _simulate(
        scenario, out, "result", figures, quiet=quiet or as_json, checkpoint=checkpoint
    )
    law = f"gains of {gains}" if gains is not None else f"{surface} surface, {scheme} scheme"
    if html is not None:
        files.append(result.save_html(html, environment=scenario.environment))
    title = f"{arm.name}, payload {payload:g} kg, {law}, dt = {controller.dt:g} s"
    if as_json:
        said = {"title": title, "joints": result.joint_names, "metrics": result_figures(result)}
        print_json(said)
        return
    if not quiet:
        print_table(result_table(title, result))
    _say_written(files)


@app.command(epilog="Example: rbimpedance tune panda --payload 2 --inertia-scale 1.1 --out out/")
def tune(
    robot: Robot,
    payload: Annotated[
        str, typer.Option("--payload", metavar="KG[,KG]", help="At the tool: largest, or a range.")
    ] = "0",
    payload_com: Annotated[
        str, typer.Option("--payload-com", metavar="X,Y,Z", help="Where, in the tool's axes in m.")
    ] = "0,0,0",
    payload_gyration: Annotated[
        str,
        typer.Option("--payload-gyration", metavar="R[,R]", help="Its radius of gyration in m."),
    ] = "0",
    inertia_scale: Annotated[
        str, typer.Option("--inertia-scale", metavar="F[,F]", help="Factor on the links' inertia.")
    ] = "1",
    viscous: Annotated[
        str, typer.Option("--viscous", metavar="D[,D]", help="Unknown friction in N m s/rad.")
    ] = "0",
    coulomb: Annotated[
        str, typer.Option("--coulomb", metavar="C[,C]", help="Unknown dry friction in N m.")
    ] = "0",
    torque_constant: Annotated[
        float, typer.Option("--torque-constant", metavar="X", help="Relative error of the torque.")
    ] = 0.0,
    position_noise: Annotated[
        float, typer.Option("--position-noise", help="Standard deviation in rad.")
    ] = 0.0,
    velocity_noise: Annotated[
        float, typer.Option("--velocity-noise", help="Standard deviation in rad/s.")
    ] = 0.0,
    delay: Annotated[int, typer.Option("--delay", help="Of the measurements in ticks.")] = 0,
    limits: Annotated[
        str | None,
        typer.Option(
            "--limits",
            metavar="urdf|T[,T...]",
            help="Torque limits to keep in N m: the description's, or these.",
        ),
    ] = None,
    accuracy: Annotated[
        float, typer.Option("--accuracy", metavar="RAD", help="Error that is asked for.")
    ] = 1e-3,
    amplitude: Annotated[
        float, typer.Option("--amplitude", help="Of the cosine reference, rad or m.")
    ] = 0.2,
    period: Annotated[float, typer.Option("--period", help="Of the cosine reference in s.")] = 6.0,
    dt: Period = 1e-3,
    duration: Duration = 5.0,
    seed: Annotated[int, typer.Option("--seed", help="Of everything random.")] = 0,
    lock: Lock = None,
    tool_frame: ToolFrame = None,
    armature: Armature = None,
    gravity: Gravity = None,
    massless: Massless = False,
    package_dir: PackageDir = None,
    xacro_arg: XacroArg = None,
    repair: Repair = False,
    out: Out = Path("out"),
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Propose gains that carry what is not known about a robot, or say why none do (exit code 1)."""
    arm = _load(
        robot,
        lock,
        tool_frame,
        armature,
        gravity,
        package_dir,
        massless=massless,
        xacro_arg=xacro_arg,
        repair=repair,
    )
    uncertainty = Uncertainty(
        payload=_numbers("--payload", payload),
        payload_com=_numbers("--payload-com", payload_com, 3),
        payload_gyration=_numbers("--payload-gyration", payload_gyration),
        inertia_scale=_numbers("--inertia-scale", inertia_scale),
        viscous=_numbers("--viscous", viscous),
        coulomb=_numbers("--coulomb", coulomb),
        torque_constant=torque_constant,
        position_noise=position_noise,
        velocity_noise=velocity_noise,
        delay=delay,
    )
    trajectory = cosine(arm, amplitude=amplitude, period=period)
    with progress(f"tuning {arm.name}", quiet=quiet or as_json) as on_tick:
        proposal = propose_gains(
            arm,
            uncertainty,
            trajectory,
            dt,
            limits=_effort_limits(arm, limits),
            accuracy=accuracy,
            duration=duration,
            seed=seed,
            on_tick=on_tick,
        )
    files = _write_proposal(proposal, out)
    if as_json:
        print_json(proposal_data(proposal))
    else:
        if not quiet:
            print_table(gains_table(proposal))
            torque = torque_table(proposal)
            if torque is not None:
                print_table(torque)
            if proposal.worst:
                print_table(worst_table(proposal))
        stdout.print(proposal.explain(), soft_wrap=True, markup=False)
        _say_written(files)
    if not proposal.feasible:
        raise typer.Exit(1)


@app.command(epilog="Example: rbimpedance inspect ur5")
def inspect(
    robot: Robot,
    lock: Lock = None,
    tool_frame: ToolFrame = None,
    armature: Armature = None,
    gravity: Gravity = None,
    massless: Massless = False,
    package_dir: PackageDir = None,
    xacro_arg: XacroArg = None,
    repair: Repair = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Show what a robot's description says: joints, limits, friction, frames, and what is odd about it."""
    arm = _load(
        robot,
        lock,
        tool_frame,
        armature,
        gravity,
        package_dir,
        massless=massless,
        xacro_arg=xacro_arg,
        repair=repair,
    )
    M = arm.mass_matrix(arm.neutral)
    if as_json:
        print_json({name: getattr(arm, name) for name in _INSPECTED})
        return
    limits = (*arm.joint_limits(), arm.velocity_limit, arm.effort_limit)
    columns = (*limits, arm.viscous, arm.coulomb, arm.armature, np.diag(M))
    rows = [
        [name, *(number(float(column[i])) for column in columns)]
        for i, name in enumerate(arm.joint_names)
    ]
    header = ("joint", "lower", "upper", "speed", "effort", "viscous", "Coulomb", "armature")
    title = f"{arm.name}: nq = {arm.nq}, nv = {arm.nv}, tool frame '{arm.tool_frame}'"
    if not quiet:
        print_table(table(title, (*header, "M(neutral)"), rows))
        stdout.print("SI units; – means: not given, or no limit", style="dim")
    for note in arm.notes:
        stdout.print(f"note: {note}", soft_wrap=True, markup=False)


@app.command(name="view", epilog="Example: rbimpedance view panda --html")
def view_command(
    shown: Annotated[
        str,
        typer.Argument(metavar="ROBOT|RESULT", help="A robot as for run, or a result (.npz)."),
    ],
    html: Annotated[
        bool, typer.Option("--html", help="Write one HTML file, and do not serve the page.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Its name; default: NAME.html.")
    ] = None,
    open_browser: Annotated[
        bool, typer.Option("--open", help="Open the system's browser.")
    ] = False,
    port: Annotated[int, typer.Option("--port", help="Port on 127.0.0.1; 0: any free one.")] = 0,
    lock: Lock = None,
    tool_frame: ToolFrame = None,
    package_dir: PackageDir = None,
    xacro_arg: XacroArg = None,
    repair: Repair = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Show a robot, or the animation of a result, in a browser: served on this machine, or as one file."""
    from ..pictures.viewer import animate, view  # noqa: PLC0415  (takes a second)

    with progress(f"drawing {shown}", quiet=quiet or as_json):
        if shown.endswith(".npz"):
            viewer = animate(SimulationResult.load(shown), port=port)
        else:
            arm = _load(  # a picture needs no masses
                shown,
                lock,
                tool_frame,
                "1",
                None,
                package_dir,
                massless=True,
                xacro_arg=xacro_arg,
                repair=repair,
            )
            viewer = view(arm, port=port)
    for note in viewer.notes if not as_json else ():
        stderr.print(f"note: {note}", soft_wrap=True, markup=False)
    if html or out is not None:
        file = viewer.save_html(out or f"{viewer.arm.name.replace('/', '_')}.html")
        if as_json:
            print_json({"file": str(file), "notes": viewer.notes})
        else:
            _say_written([file])
        return
    with viewer:
        if as_json:
            print_json({"url": viewer.url, "notes": viewer.notes})
        else:
            stdout.print(f"{viewer.url} shows it, until Ctrl-C", soft_wrap=True, markup=False)
        if open_browser:
            _open(viewer)
        with suppress(KeyboardInterrupt):
            Event().wait()


app.command(epilog="Example: rbimpedance bench panda --compare before.json")(bench)
app.command(epilog="Example: rbimpedance study standard --jobs 2")(study)


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and leave.")
    ] = False,
) -> None:
    if version:
        print(f"rbimpedance {__version__}")
        raise typer.Exit


def main() -> None:
    """Run the command line; every expected failure becomes a message and an exit code."""
    try:
        app()
    except DivergenceError as error:
        stderr.print(f"failed: {error}", soft_wrap=True, markup=False)
        sys.exit(1)
    except RBImpedanceError as error:
        stderr.print(f"error: {error}", soft_wrap=True, markup=False)
        sys.exit(2)
    except OSError as error:
        what = f"{error.strerror}: '{error.filename}'" if error.filename else str(error)
        stderr.print(f"error: {what}", soft_wrap=True, markup=False)
        sys.exit(2)


def _load(
    robot: str,
    lock: list[str] | None,
    tool_frame: str | None,
    armature: str | None,
    gravity: str | None,
    package_dir: list[Path] | None,
    *,
    massless: bool,
    xacro_arg: list[str] | None,
    repair: bool,
) -> ArmModel:
    return load_robot(
        _standard_input() if robot == "-" else robot,
        lock=tuple(lock or ()),
        tool_frame=tool_frame,
        armature=None if armature is None else _numbers("--armature", armature),
        gravity=None if gravity is None else _numbers("--gravity", gravity, 3),
        package_dirs=tuple(package_dir or ()),
        xacro_args=_xacro_arguments(xacro_arg),
        massless=massless,
        repair=repair,
    )


def _xacro_arguments(given: list[str] | None) -> dict[str, str]:
    """Read "name:=value" from each."""
    pairs = {}
    for text in given or ():
        name, separator, value = text.partition(":=")
        if not name or not separator:
            raise ParameterError("--xacro-arg", text, "NAME:=VALUE")
        pairs[name] = value
    return pairs


def _standard_input() -> str:
    """The text on standard input, bounded in size."""
    text, _ = decoded(sys.stdin.buffer.read(MAX_CHARACTERS + 1), "standard input", ())
    return text


def _numbers(option: str, text: str, count: int | None = None) -> Array:
    """Read "1" or "1,2,3"; a single number stays a scalar unless a count is asked for."""
    wanted = (
        "a number or numbers separated by commas" if count is None else f"{count} numbers, a,b,c"
    )
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError as error:
        raise ParameterError(option, text, wanted) from error
    if count is not None and len(values) != count:
        raise ParameterError(option, text, wanted)
    return values if count is not None or len(values) > 1 else values[0]


def _effort_limits(arm: ArmModel, limits: str | None) -> Array | None:
    """Read "urdf", or numbers."""
    if limits != "urdf":
        return None if limits is None else _numbers("--limits", limits)
    if not np.isfinite(arm.effort_limit).any():
        raise ParameterError(
            "--limits", limits, f"numbers: '{arm.name}' comes without effort limits"
        )
    return arm.effort_limit


def _simulate(
    scenario: Scenario,
    out: Path,
    name: str,
    figures: Mapping[str, Callable[[SimulationResult], Figure]],
    *,
    quiet: bool,
    checkpoint: Checkpoint | None = None,
) -> tuple[SimulationResult, list[Path]]:
    """Run a scenario and write its data and figures, those of a diverged run too."""
    out.mkdir(parents=True, exist_ok=True)
    remove_parts(out / f"{name}.npz")
    try:
        with progress(f"simulating {scenario.plant.name}", quiet=quiet) as on_tick:
            result = scenario.simulate(on_tick=on_tick, checkpoint=checkpoint)
    except DivergenceError as error:
        path = error.result.save(out / f"{name}.npz")
        if checkpoint is not None:
            checkpoint.remove()
        stderr.print(f"the run until it diverged is in {path}", soft_wrap=True, markup=False)
        raise
    files = [plotting.save(draw(result), out / f"{stem}.png") for stem, draw in figures.items()]
    files.append(result.save(out / f"{name}.npz"))
    if checkpoint is not None:
        checkpoint.remove()
    return result, files


def _write_proposal(proposal: GainProposal, out: Path) -> list[Path]:
    """Write gains.json, and the errors of the worst samples where any was simulated."""
    out.mkdir(parents=True, exist_ok=True)
    files = [save_gains(proposal, out / "gains.json")]
    if proposal.worst:
        cases = zip(case_names(proposal), proposal.worst, strict=True)
        runs = {name: (case.result.t, case.true_error) for name, case in cases}
        files.append(plotting.save(plotting.error_sizes(runs), out / "worst_samples.png"))
    return files


def _compare(dt: float, duration: float, *, quiet: bool) -> dict[str, SimulationResult]:
    """Run every law of `paper_comparison`; one that diverges is compared by what it did until then."""
    results: dict[str, SimulationResult] = {}
    for name, scenario in paper_comparison(dt=dt, duration=duration).items():
        with progress(name, quiet=quiet) as on_tick:
            try:
                results[name] = scenario.simulate(on_tick=on_tick)
            except DivergenceError as error:
                results[f"{name} (diverged)"] = error.result
    return results


def _open(viewer: Viewer) -> None:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        viewer.open()
    for warning in said:
        stderr.print(f"note: {warning.message}", soft_wrap=True, markup=False)


def _say_written(files: list[Path]) -> None:
    stdout.print("written: " + ", ".join(str(path) for path in files), soft_wrap=True, markup=False)


_INSPECTED = (
    *("name", "nq", "nv", "joint_names", "tool_frame", "frame_names"),
    *("neutral", "ready", "lower", "upper"),
    *("effort_limit", "velocity_limit", "viscous", "coulomb", "armature", "notes"),
)
