"""The standard study: six arms, twelve disturbances, ten controllers, fixed seeds (docs/standard-study.md)."""

from dataclasses import replace

from ..definition import Study
from .arms import ROBOTS
from .controllers import CONTROLLERS, WITH_AN_INTEGRAL
from .disturbances import DISTURBANCES

STANDARD = Study(
    name="standard",
    robots=ROBOTS,
    controllers=CONTROLLERS,
    disturbances=DISTURBANCES,
    samples=7,
    duration=5.0,
    after=1.0,
    seed=2026,
)
"""5,040 runs of 5 s."""

LINEAR = replace(STANDARD, name="linear", controllers=WITH_AN_INTEGRAL)
"""The same experiments with PIDs around the same reference: 2,016 runs."""
