"""`Uncertainty`: what a user does not know about an arm, and plants drawn from it."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._common.arrays import Array, per_joint, size, whole_number
from .._common.brief import brief_repr
from .._common.frozen import Converted, Gain, OptionalGain, unless_none
from ..robot.arm_model import ArmModel
from .plant_sample import PlantSample, tilted, with_body
from .ranges import (
    box,
    constant_range,
    is_not_negative,
    is_positive,
    is_within,
    range_of,
    scalar_range,
)

CORNERS = 16
"""At most this many extremes are among the first samples."""


_CHANGED, _LEAST_SHARE = 2.0, 0.12  # of the ranges, in plants near another
_FIELDS = {"payload_gyration": "gyration"}  # of a sample, where it has another name than the range

_from_0 = partial(range_of, nominal=0.0, is_admissible=is_not_negative)
_number_from_0 = partial(scalar_range, nominal=0.0, is_admissible=is_not_negative)


@brief_repr(omit_defaults=True)
@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Ranges of what the controller's model may be wrong about; everything is as the arm's model says by default.

    A range is a (lowest, highest) pair, or one number, which means all from "as modelled" to that number.

    Attributes:
        payload: Mass at the payload frame [kg], shape (2,).
        payload_com: Its position in that frame's axes [m], shape (2, 3): one point, or the corners of a box.
        payload_gyration: Its radius of gyration r about the centre of mass, equal about all axes, shape (2,) [m]: its
            rotational inertia is mass·r². A point mass by default; a ball of radius R has 0.63·R, a cube of edge a
            0.41·a, and for a body that is not as round the largest of its three is on the safe side.
        payload_frame: Frame of the payload; the tool frame by default.
        inertia_scale: Factor on all links' masses and inertias, shape (2,).
        viscous: Friction beyond what the arm's model has, shape (2,) or (2, nv) [N·m·s/rad or N·s/m].
        coulomb: The same, shape (2,) or (2, nv) [N·m or N].
        armature: True reflected rotor inertia, shape (2,) or (2, nv) [kg·m² or kg]; None where the arm's own is right.
        torque_constant: Ratio of true to demanded torque, shape (2,) or (2, nv); one number x means
            an error of either sign, (1 - x, 1 + x).
        gravity_tilt: Largest angle between gravity and what the model takes it for [rad].
        position_noise: Standard deviation of white noise on q [rad or m].
        velocity_noise: Standard deviation of white noise on v [rad/s or m/s].
        delay: Ticks from a measurement to the torque that it leads to.

    Raises:
        ParameterError: A range that is empty, or with values that cannot be.
        DimensionError: Neither a number nor a pair.
    """

    payload: Gain = Converted(_number_from_0, 0.0)
    inertia_scale: Gain = Converted(
        partial(scalar_range, nominal=1.0, is_admissible=is_positive), 1.0
    )
    viscous: Gain = Converted(_from_0, 0.0)
    coulomb: Gain = Converted(_from_0, 0.0)
    _: KW_ONLY
    payload_com: Gain = Converted(box, (0.0, 0.0, 0.0))
    payload_gyration: Gain = Converted(_number_from_0, 0.0)
    payload_frame: str | None = None
    armature: OptionalGain = Converted(unless_none(_from_0), None)
    torque_constant: Gain = Converted(constant_range, 0.0)
    gravity_tilt: Converted[float, float] = Converted(size, 0.0)
    position_noise: Converted[float, float] = Converted(size, 0.0)
    velocity_noise: Converted[float, float] = Converted(size, 0.0)
    delay: Converted[int, int] = Converted(whole_number, 0)

    def sample(self, arm: ArmModel, count: int, *, seed: int = 0) -> tuple[PlantSample, ...]:
        """Draw plants: first the extremes (payload and inertia vary fastest), then uniformly within the ranges.

        Sample i depends on the seed and on i alone, so a longer draw begins with the shorter one.

        Args:
            arm: The arm as it is modelled.
            count: How many, at least 1.
            seed: Of the draw and of the noise.

        Raises:
            ParameterError: `count` or `seed` is not a whole number, or `count` is 0.
            DimensionError: A range is given for another number of joints.
            ModelError: The arm has no frame `payload_frame`.
        """
        whole_number("count", count, 1)
        ranges = self._ranges(arm)
        uncertain = [name for name, range_ in ranges.items() if (range_[0] != range_[1]).any()]
        corners = min(2 ** len(uncertain), CORNERS)
        samples = []
        for i in range(count):
            rng = np.random.default_rng((whole_number("seed", seed), i))
            share = {name: rng.uniform(size=range_.shape[1]) for name, range_ in ranges.items()}
            if i < corners:
                share |= {name: _bit(i, k) for k, name in enumerate(uncertain)}
            drawn = {name: low + share[name] * (high - low) for name, (low, high) in ranges.items()}
            samples.append(self._plant(arm, drawn, seed=1000 * seed + i))
        return tuple(samples)

    def extremes(self, arm: ArmModel) -> tuple[PlantSample, ...]:
        """Return the corners of the ranges alone, at most `CORNERS`.

        Args:
            arm: The arm as it is modelled.
        """
        uncertain = sum((low != high).any() for low, high in self._ranges(arm).values())
        return self.sample(arm, min(2**uncertain, CORNERS))

    def corners(self, arm: ArmModel, count: int, *, seed: int = 0) -> tuple[PlantSample, ...]:
        """Draw plants with every range at one of its ends, joint by joint and axis by axis, apart from each other.

        Arguments and errors are those of `sample`; corners may repeat where there are fewer than `count`.
        """
        whole_number("count", count, 1)
        rng, ranges = np.random.default_rng(whole_number("seed", seed)), self._ranges(arm)
        drawn = [
            {
                name: np.where(rng.integers(2, size=low.shape) == 1, high, low)
                for name, (low, high) in ranges.items()
            }
            for _ in range(count)
        ]
        return tuple(self._plant(arm, each, seed=1000 * seed + i) for i, each in enumerate(drawn))

    def dimension(self, arm: ArmModel) -> int:
        """Return the number of quantities that plants of an arm may differ in, each joint and axis counted apart."""
        return sum(low.size for low, _ in self._ranges(arm).values())

    def at(self, arm: ArmModel, share: Array, *, seed: int = 0) -> PlantSample:
        """Return the plant at one point of the ranges, as for a design of experiments (`scipy.stats.qmc`).

        Args:
            arm: The arm as it is modelled.
            share: Of each range, 0 at its lowest end and 1 at its highest, shape (`dimension`,): payload, inertia
                scale, gyration, armature, viscous and dry friction and torque constant of every joint, position of the
                payload, tilt about x and y.
            seed: Of the noise.
        """
        ranges = self._ranges(arm)
        ends = np.cumsum([low.size for low, _ in ranges.values()])[:-1]
        parts = zip(ranges.items(), np.split(share, ends), strict=True)
        drawn = {name: low + part * (high - low) for (name, (low, high)), part in parts}
        return self._plant(arm, drawn, seed=seed)

    def near(
        self, arm: ArmModel, sample: PlantSample, count: int, *, seed: int = 0
    ) -> tuple[PlantSample, ...]:
        """Draw plants that differ from one in a few ranges, which are at one of their ends, as a search from it needs.

        Args:
            arm: The arm as it is modelled.
            sample: The plant.
            count: How many.
            seed: Of the draw and of the noise.
        """
        rng, ranges = np.random.default_rng(whole_number("seed", seed)), self._ranges(arm)
        share = max(_CHANGED / self.dimension(arm), _LEAST_SHARE)
        own = vars(sample)
        drawn = [
            {
                name: np.where(
                    rng.uniform(size=low.shape) < share,
                    np.where(rng.integers(2, size=low.shape) == 1, high, low),
                    own[_FIELDS.get(name, name)],
                )
                for name, (low, high) in ranges.items()
            }
            for _ in range(count)
        ]
        return tuple(self._plant(arm, each, seed=1000 * seed + i) for i, each in enumerate(drawn))

    def outside(self, sample: PlantSample) -> tuple[str, ...]:
        """Return in words what of an arm lies outside these ranges, so that gains that were made for them need not do.

        Args:
            sample: The arm; friction beyond the model's, as `sample` of another uncertainty draws it.
        """
        own: dict[str, tuple[str, Any, ArrayLike]] = {
            "payload": ("kg", self.payload, sample.payload),
            "payload centre of mass": ("m", self.payload_com, sample.com),
            "payload gyration": ("m", self.payload_gyration, sample.gyration),
            "inertia scale": ("", self.inertia_scale, sample.inertia_scale),
            "viscous friction": ("N·m·s/rad", self.viscous, sample.viscous),
            "dry friction": ("N·m", self.coulomb, sample.coulomb),
            "torque constant": ("", self.torque_constant, sample.torque_constant),
            "position noise": ("rad", (0.0, self.position_noise), sample.position_noise),
            "velocity noise": ("rad/s", (0.0, self.velocity_noise), sample.velocity_noise),
            "delay": ("ticks", (0, self.delay), sample.delay),
        }
        if sample.payload == 0.0:  # nothing whose place or size counts
            del own["payload centre of mass"], own["payload gyration"]
        return tuple(
            f"{name} {_words(value)} {unit}".rstrip()
            + f" instead of {_words(low)} to {_words(high)}"
            for name, (unit, (low, high), value) in own.items()
            if not is_within(value, low, high)
        )

    def but(self, **changes: Any) -> Uncertainty:
        """Return a copy with other ranges, by the names of the attributes."""
        return Uncertainty(**({name: getattr(self, name) for name in vars(self)} | changes))

    def _ranges(self, arm: ArmModel) -> dict[str, Array]:
        """Every range with its lowest and highest entries as two vectors."""
        own = np.stack([arm.armature, arm.armature])
        per_joints = {
            "armature": own if self.armature is None else self.armature,
            "viscous": self.viscous,
            "coulomb": self.coulomb,
            "torque_constant": self.torque_constant,
        }
        tilt = np.full(2, self.gravity_tilt / np.sqrt(2.0))
        return (
            {
                name: getattr(self, name)[:, None]
                for name in ("payload", "inertia_scale", "payload_gyration")
            }
            | {
                name: np.stack([per_joint(name, bound, arm.nv) for bound in range_])
                for name, range_ in per_joints.items()
            }
            | {"com": self.payload_com, "tilt": np.stack([-tilt, tilt])}
        )

    def _plant(self, arm: ArmModel, drawn: dict[str, Array], seed: int) -> PlantSample:
        """Build one plant from what was drawn; what equals the model leaves the model as it is."""
        payload, scale = float(drawn["payload"][0]), float(drawn["inertia_scale"][0])
        gyration = float(drawn["payload_gyration"][0])
        plant = arm.with_scaled_inertia(scale) if scale != 1.0 else arm
        if drawn["viscous"].any() or drawn["coulomb"].any():
            plant = plant.with_friction(
                arm.viscous + drawn["viscous"], arm.coulomb + drawn["coulomb"]
            )
        if (drawn["armature"] != arm.armature).any():
            plant = plant.with_armature(drawn["armature"])
        if drawn["tilt"].any():
            gravity = np.array(arm.raw_dynamics.model.gravity.linear)
            plant = plant.with_gravity(tilted(gravity, drawn["tilt"]))
        return PlantSample(
            plant=with_body(plant, payload, drawn["com"], gyration, self.payload_frame),
            payload=payload,
            gyration=gyration,
            inertia_scale=scale,
            **{k: drawn[k] for k in ("com", "viscous", "coulomb", "armature", "torque_constant")},
            tilt=drawn["tilt"],
            position_noise=self.position_noise,
            velocity_noise=self.velocity_noise,
            delay=self.delay,
            seed=seed,
        )


def _words(value: ArrayLike) -> str:
    """One number where all are equal, else each."""
    numbers = np.ravel(value)
    few = numbers[:1] if (numbers == numbers[0]).all() else numbers
    return ",".join(f"{x:g}" for x in few)


def _bit(i: int, k: int) -> float:
    """1.0 at the high end of range k in corner i, else 0.0; corner 0 is high everywhere."""
    return float(not (i >> k) & 1)
