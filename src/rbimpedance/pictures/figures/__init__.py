"""Figures of results, in one style; every function returns a matplotlib `Figure` and opens no window."""

from .analysis import chatter_spectrum as chatter_spectrum
from .analysis import convergence as convergence
from .analysis import interaction_energy as interaction_energy
from .analysis import phase_plane as phase_plane
from .analysis import robustness_map as robustness_map
from .analysis import torque_margins as torque_margins
from .runs import comparison as comparison
from .runs import disturbance as disturbance
from .runs import error_sizes as error_sizes
from .runs import impedance_error as impedance_error
from .runs import save as save
from .runs import torques as torques
from .runs import tracking_errors as tracking_errors
from .style import COLORS as COLORS
from .tool import tool_errors as tool_errors
from .tool import tool_path as tool_path
