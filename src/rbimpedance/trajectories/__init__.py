"""References for the controller: a trajectory is a callable t -> `Reference`.

`hold`, `cosine` and `waypoints` are formulas; `samples`, `from_csv` and `from_joint_trajectory` pass smoothly through
given samples, a `ChunkReference` through chunks that arrive while it runs. All refuse positions outside the arm's
limits. The room uses `robot` and what lies below it.
"""

from __future__ import annotations

from . import cartesian as cartesian
from .chunks import ChunkReference as ChunkReference
from .limits import amplitude_within_limits as amplitude_within_limits
from .messages import from_csv as from_csv
from .messages import from_joint_trajectory as from_joint_trajectory
from .motions import cosine as cosine
from .motions import hold as hold
from .motions import waypoints as waypoints
from .reference import Reference as Reference
from .reference import SampledTrajectory as SampledTrajectory
from .reference import Trajectory as Trajectory
from .samples import samples as samples
