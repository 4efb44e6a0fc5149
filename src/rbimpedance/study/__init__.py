"""Studies: many controllers on many robots under many disturbances, one table."""

from .definition import Experiment as Experiment
from .definition import Study as Study
from .definition import Task as Task
from .execution import run_study as run_study
from .finding import find_study as find_study
from .folder import StudyError as StudyError
from .summary import summarize as summarize
