"""Proposals as JSON files: what `rbimpedance tune` writes and `rbimpedance run --gains` reads."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array
from ..control.cartesian import CartesianController
from ..control.controller import ImpedanceController
from ..exceptions import ModelError, ParameterError
from ..law.cartesian_impedance import CartesianImpedance
from ..law.damped_inverse import Damping
from ..law.impedance import Impedance
from ..law.limits import Limits
from ..law.super_twisting import SuperTwisting
from ..law.surfaces import FastTerminalSurface, PowerSurface, Surface
from ..robot.arm_model import ArmModel
from .plant_sample import PlantSample, with_body
from .proposal import GainProposal
from .tool_proposal import BLOCKS, CartesianGainProposal, law_at_tool
from .torque_demand import TorqueDemand
from .uncertainty import Uncertainty

_FORMAT = 2
_SURFACES = {surface.__name__: surface for surface in (FastTerminalSurface, PowerSurface)}


@dataclass(frozen=True, eq=False, kw_only=True)
class Gains:
    """Gains out of a file, and the model that they were made for.

    Attributes:
        robot: Name of the arm.
        joint_names: Its joints.
        dt: Control period [s].
        k1: Gain of the root, shape (nv,); at a frame (3,), for translation, rotation and null space.
        k2: Gain of the integral, likewise.
        margin: Of the matched scheme, likewise.
        surface: Sliding surface.
        payload: Mass that the controller's model holds [kg].
        payload_com: Its position, shape (3,) [m].
        payload_frame: Its frame; None for the tool frame.
        payload_gyration: Its radius of gyration [m].
        armature: Of the controller's model, shape (nv,) [kg·m² or kg].
        limits: Of the actuators that the gains were made for; None for none.
        uncertainty: What they were made for.
        digest: Of the arm that they were made for; None in files that do not say it.
        frame: Name of the frame, for gains at the tool; None for gains of the joints.
        damping: Of the Jacobian's inverse there.
    """

    robot: str
    joint_names: tuple[str, ...]
    dt: float
    k1: Array
    k2: Array
    margin: Array
    surface: Surface
    payload: float
    payload_com: Array
    payload_frame: str | None
    payload_gyration: float
    armature: Array
    limits: Limits | None
    uncertainty: Uncertainty
    digest: str | None = None
    frame: str | None = None
    damping: Damping | None = None

    def outside(self, arm: ArmModel, sample: PlantSample) -> tuple[str, ...]:
        """Return in words what of a task lies outside that for which the gains were made.

        Args:
            arm: The arm as it is modelled.
            sample: The arm that is to be controlled.
        """
        said = self.uncertainty.outside(sample)
        if arm.name != self.robot:
            said += (f"robot '{arm.name}' instead of '{self.robot}'",)
        elif self.digest not in {None, arm.digest}:
            words = "its masses, friction, armature, gravity or limits differ"
            said += (f"another description of '{arm.name}': {words}",)
        return said

    @overload
    def controller(
        self, arm: ArmModel, impedance: Impedance, *, limits: Limits | ArrayLike | None = None
    ) -> ImpedanceController: ...

    @overload
    def controller(
        self,
        arm: ArmModel,
        impedance: CartesianImpedance,
        *,
        limits: Limits | ArrayLike | None = None,
    ) -> CartesianController: ...

    def controller(
        self,
        arm: ArmModel,
        impedance: Impedance | CartesianImpedance,
        *,
        limits: Limits | ArrayLike | None = None,
    ) -> ImpedanceController | CartesianController:
        """Build the controller for an arm as it was modelled, before the payload.

        Args:
            arm: The arm.
            impedance: Target impedance; a `CartesianImpedance` where the gains are for a frame.
            limits: Of the actuators; those of the file by default, +inf for none.

        Raises:
            ParameterError: The file is for other joints, or the impedance is of the joints and the gains of a frame, or
                the other way round.
        """
        if arm.joint_names != self.joint_names:
            raise ParameterError(
                "gains", f"for {self.robot}: {', '.join(self.joint_names)}", f"for '{arm.name}'"
            )
        body = (self.payload, self.payload_com, self.payload_gyration, self.payload_frame)
        model = with_body(arm, *body).with_armature(self.armature)
        limits = self.limits if limits is None else limits
        if isinstance(impedance, CartesianImpedance):
            if self.frame is None:
                raise ParameterError("gains", "of the joints", "for a frame")
            return law_at_tool(model, impedance, self, limits=limits)
        if self.frame is not None:
            raise ParameterError("gains", f"for the frame '{self.frame}'", "of the joints")
        reaching = SuperTwisting(self.k1, self.k2, "matched", self.margin)
        return ImpedanceController(model, impedance, self.surface, reaching, self.dt, limits=limits)


def proposal_data(proposal: GainProposal | CartesianGainProposal) -> dict[str, Any]:
    """Return a proposal as plain JSON data, gains and the numbers behind them."""
    uncertainty = proposal.uncertainty
    own = (
        _at_tool(proposal) if isinstance(proposal, CartesianGainProposal) else _of_joints(proposal)
    )
    data = {
        "format": _FORMAT,
        "robot": proposal.nominal.name,
        "digest": proposal.nominal.digest,
        "joint_names": proposal.nominal.joint_names,
        "feasible": proposal.feasible,
        "reason": proposal.reason,
        "dt": proposal.dt,
        "scheme": "matched",
        "k1": proposal.k1,
        "k2": proposal.k2,
        "margin": np.broadcast_to(proposal.margin, proposal.k1.shape),
        "surface": {"type": type(proposal.surface).__name__}
        | {name: x for name, x in vars(proposal.surface).items() if not name.startswith("_")},
        "model": {
            "payload": proposal.payload,
            "payload_com": uncertainty.payload_com.mean(axis=0),
            "payload_frame": uncertainty.payload_frame,
            "payload_gyration": uncertainty.payload_gyration.mean(),
            "armature": proposal.arm.armature,
        },
        "limits": None if proposal.limits is None else vars(proposal.limits),
        "uncertainty": vars(uncertainty),
        "worst": [_worst(case) for case in proposal.worst],
    }
    plain: dict[str, Any] = _plain(data | own)
    return plain


def _of_joints(proposal: GainProposal) -> dict[str, Any]:
    mismatch = proposal.mismatch
    return {
        "joint": proposal.joint,
        "remedies": proposal.remedies,
        "bounds": vars(mismatch)
        | {name: getattr(proposal, name) for name in ("error", "noise_error", "noise_torque")}
        | {"rho": mismatch.rho, "gain_limit": proposal.gain_limit},
        "torque": None if proposal.torque is None else _torque(proposal.torque),
    }


def _at_tool(proposal: CartesianGainProposal) -> dict[str, Any]:
    mismatch = proposal.mismatch
    return {
        "frame": proposal.frame,
        "blocks": BLOCKS,
        "block": proposal.block,
        "damping": vars(proposal.damping),
        "bounds": vars(mismatch)
        | {name: getattr(proposal, name) for name in ("missed", "error", "noise_error")}
        | {"rho": mismatch.rho},
    }


def save_gains(
    proposal: GainProposal | CartesianGainProposal, path: str | os.PathLike[str]
) -> Path:
    """Write a proposal as JSON, a refused one too.

    Args:
        proposal: From `propose_gains`.
        path: Where to.

    Raises:
        ParameterError: A surface of one's own: a file cannot hold its formula.
    """
    if type(proposal.surface) not in _SURFACES.values():
        raise ParameterError(
            "surface",
            proposal.surface,
            f"of a kind that gains files support: {', '.join(_SURFACES)}",
        )
    target = Path(path)
    text = json.dumps(proposal_data(proposal), indent=2, allow_nan=False)
    target.write_text(text + "\n", encoding="utf-8")
    return target


def load_gains(path: str | os.PathLike[str]) -> Gains:
    """Read the gains of a proposal that `save_gains` wrote.

    Args:
        path: The file.

    Raises:
        ModelError: The file is missing or damaged, or of another format.
        ParameterError: The proposal in it was refused.
    """
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
        if data["format"] != _FORMAT:
            raise ModelError(
                f"'{path}' has gains format {data['format']}; this version reads {_FORMAT}"
            )
        if data["feasible"]:
            return _gains(data)
    except FileNotFoundError as error:
        raise ModelError(f"no gains file '{path}'") from error
    except (ParameterError, ModelError):
        raise
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ModelError(f"'{path}' is not a complete file written by save_gains") from error
    raise ParameterError("gains", data["reason"], f"feasible; those in '{path}' were refused")


def _gains(data: Mapping[str, Any]) -> Gains:
    surface = dict(data["surface"])
    model = data["model"]
    return Gains(
        robot=data["robot"],
        joint_names=tuple(data["joint_names"]),
        dt=float(data["dt"]),
        **{name: np.array(data[name], dtype=np.float64) for name in ("k1", "k2", "margin")},
        surface=_SURFACES[surface.pop("type")](**surface),
        payload=float(model["payload"]),
        payload_com=np.array(model["payload_com"], dtype=np.float64),
        payload_frame=model["payload_frame"],
        payload_gyration=float(model["payload_gyration"]),
        armature=np.array(model["armature"], dtype=np.float64),
        limits=_limits(data["limits"]),
        uncertainty=Uncertainty(**data["uncertainty"]),
        digest=data.get("digest"),
        frame=data.get("frame"),
        damping=Damping(**data["damping"]) if "damping" in data else None,
    )


def _limits(data: Mapping[str, Any] | None) -> Limits | None:
    """Limits from plain data, in which null means infinity."""
    if data is None:
        return None
    return Limits(**{name: _infinite_where_null(value) for name, value in data.items()})


def _infinite_where_null(value: Any) -> Array:
    numbers = np.array(value, dtype=np.float64)
    return np.where(np.isnan(numbers), np.inf, numbers)


def _torque(demand: TorqueDemand) -> dict[str, Any]:
    names = ("needed", "reserve", "limit", "lack", "rate_needed", "rate_limit", "rate_lack", "time")
    return {name: getattr(demand, name) for name in names}


def _worst(case: Any) -> dict[str, Any]:
    sample = case.sample
    drawn = {name: value for name, value in vars(sample).items() if name != "plant"}
    names = ("noisy", "error", "variation", "needed", "reason")
    return drawn | {name: getattr(case, name) for name in names}


def _plain(value: Any) -> Any:
    """Plain JSON data; infinite numbers become null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
