"""Chunks on Dask's workers: processes of this machine, or a cluster."""

from __future__ import annotations

import logging
import pickle
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from platform import python_version
from typing import Any
from uuid import uuid4

from ..exceptions import MissingExtraError
from .chunk import VERSIONS, Answer, Tasks, run_chunk, versions
from .definition import Study
from .folder import Chunk, StudyError
from .measures import Figures

_here = threading.local()


@contextmanager
def cluster(jobs: int, scheduler: str | None) -> Iterator[Any]:
    """Connect to a cluster, or start one on this machine for as long as it is needed.

    Args:
        jobs: Processes on this machine; none where there is a scheduler.
        scheduler: Address of a scheduler.

    Raises:
        MissingExtraError: Dask is not installed.
        StudyError: A worker of the cluster has other versions.
    """
    try:
        import dask  # noqa: PLC0415 (an extra)
        from distributed import Client, LocalCluster  # noqa: PLC0415
    except ImportError as error:
        raise MissingExtraError("a study on several processes", "study") from error
    if scheduler is not None:
        with Client(scheduler) as client:
            check_workers(client)
            yield client
        return
    settings: dict[str, Any] = {
        "distributed.nanny.pre-spawn-environ.VECLIB_MAXIMUM_THREADS": 1,  # the others are Dask's own
        "distributed.scheduler.worker-saturation": 1.0,  # one chunk dies with a worker
        "distributed.scheduler.http.routes": [],
        "distributed.worker.http.routes": [],
    }
    with (
        dask.config.set(settings),
        LocalCluster(
            n_workers=jobs,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
            memory_limit=0,
            silence_logs=logging.CRITICAL,
        ) as local,
        Client(local) as client,
    ):
        yield client


def run_on(client: Any, study: Study, chunks: Sequence[Chunk]) -> Iterator[tuple[Chunk, Answer]]:
    """Return what comes of each chunk as it comes, or the reason why nothing does.

    Args:
        client: Of the cluster.
        study: The study.
        chunks: What is to be computed.

    Raises:
        StudyError: The workers cannot load the study.
    """
    import cloudpickle  # noqa: PLC0415
    from distributed import KilledWorker, as_completed  # noqa: PLC0415

    run, told = uuid4().hex, cloudpickle.dumps(study)
    futures = {
        client.submit(_on_worker, run, told, *chunk, key=f"{run}-{i}"): chunk
        for i, chunk in enumerate(chunks)
    }
    try:
        for future in as_completed(list(futures)):
            error = future.exception()
            if isinstance(error, KilledWorker):
                yield futures[future], f"its worker died, {error.allowed_failures + 1} times"
            elif error is not None:
                raise StudyError(f"the workers cannot run the study: {error!r}") from error
            else:
                yield futures[future], future.result()
    finally:
        client.cancel(list(futures))


def check_workers(client: Any) -> None:
    """Refuse workers on which other versions would compute.

    Args:
        client: Of the cluster.

    Raises:
        StudyError: A worker has other versions than this process, or none.
    """
    try:
        told = {name: client.run(version, name) for name in VERSIONS}
    except PackageNotFoundError as error:
        raise StudyError(f"a worker of the cluster has no '{error.name}' installed") from error
    told["python"] = client.run(python_version)
    for name, of_workers in told.items():
        own = versions()[f"version_{name}"]
        for worker, found in of_workers.items():
            if found != own:
                raise StudyError(f"worker {worker} has {name} {found}; this process has {own}")


def _on_worker(run: str, told: bytes, robot: str, disturbance: str) -> list[Figures]:
    """Compute one chunk, with what earlier chunks of this start of the study left in the thread."""
    if getattr(_here, "run", None) != run:
        study: Study = pickle.loads(told)
        _here.run, _here.study, _here.tasks = run, study, Tasks(study)
    return run_chunk(_here.study, robot, disturbance, _here.tasks)
