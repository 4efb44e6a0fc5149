"""Running a study: here, on the cores of this machine, or on a cluster, in any order, over any number of starts."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from .._common.arrays import whole_number
from .chunk import Answer, Tasks, lost, run_chunk
from .definition import Study
from .folder import Chunk, StudyFolder
from .measures import Figures
from .on_dask import cluster, run_on
from .table import arrow

if TYPE_CHECKING:
    import pyarrow as pa

OnRun: TypeAlias = Callable[[int, int], None]
"""Called with (runs done, runs in all)."""


def run_study(
    study: Study,
    out: str | os.PathLike[str],
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    on_run: OnRun | None = None,
) -> pa.Table:
    """Run a study, or its remaining part, and return its table: one row per run, failures included.

    The folder keeps every chunk that is done, a robot under a disturbance, so that a study that was stopped or killed
    continues. The table does not depend on the workers, their order and the number of restarts. A
    worker that dies costs its chunk, which is computed again; the rows of one that no worker survives say so, and it is
    tried again when the study is started again.

    With more than one job, and on a cluster, other processes import the program that calls this: it needs
    `if __name__ == "__main__":`. The study is sent to them; what it uses has to be installed there.

    Args:
        study: The study.
        out: Folder of the study; its table is written there as `<name>.parquet`.
        jobs: Processes on this machine; 1 for this one alone, which needs no Dask.
        scheduler: Address of a Dask scheduler, such as "tcp://10.0.0.1:8786", in place of processes of its own.
        on_run: Called with (runs done, runs in all); by chunks where other processes compute.

    Returns:
        The table, with a row for each run in the order of robots, disturbances, samples and controllers; `COLUMNS` of
        `rbimpedance.study.table`, and what was drawn.

    Raises:
        StudyError: The folder is of another study.
        MissingExtraError: pyarrow, or Dask, is not installed.
        ParameterError: `jobs` is not a positive whole number.
    """
    whole_number("jobs", jobs, 1, "processes")
    arrow()
    folder = StudyFolder(study, Path(out))
    missing = [chunk for chunk in study.chunks if folder.rows(chunk) is None]
    progress = _Progress(study, len(missing), on_run)
    gone: dict[Chunk, list[Figures]] = {}
    with _answers(study, missing, jobs, scheduler, progress) as answers:
        for chunk, answer in answers:
            if isinstance(answer, str):
                gone[chunk] = lost(study, *chunk, answer)
            else:
                folder.keep(chunk, answer)
    return folder.finish(gone)


class _Progress:
    """Counts runs."""

    def __init__(self, study: Study, missing: int, on_run: OnRun | None) -> None:
        self.total, self.on_run = study.runs, on_run
        self.done = study.runs - missing * study.runs_per_chunk
        self.add(0)

    def add(self, runs: int = 1) -> None:
        self.done += runs
        if self.on_run is not None:
            self.on_run(self.done, self.total)


@contextmanager
def _answers(
    study: Study, chunks: Sequence[Chunk], jobs: int, scheduler: str | None, progress: _Progress
) -> Iterator[Iterator[tuple[Chunk, Answer]]]:
    """What comes of chunks, or why nothing did, by whatever computes them."""
    if not chunks or (jobs == 1 and scheduler is None):
        tasks = Tasks(study)
        yield ((chunk, run_chunk(study, *chunk, tasks, progress.add)) for chunk in chunks)
        return
    with cluster(min(jobs, len(chunks)), scheduler) as client:
        yield _counted(run_on(client, study, chunks), study.runs_per_chunk, progress)


def _counted(
    answers: Iterator[tuple[Chunk, Answer]], runs: int, progress: _Progress
) -> Iterator[tuple[Chunk, Answer]]:
    for chunk, answer in answers:
        yield chunk, answer
        progress.add(runs)
