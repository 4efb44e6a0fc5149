"""npz files of a log."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .._common.files import whole_file
from ..exceptions import LogError
from .formats import Read, Wanted
from .samples import CHANNELS, Samples, to_stamps

_OTHER_NAMES = {"q": "position", "v": "velocity", "tau": "effort", "tau_ext": "external"}


def read(path: Path, wanted: Wanted) -> Read:
    """Return the samples of an npz file: arrays "stamps" [ns] or "t" [s], "joint_names", and the channels."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {_OTHER_NAMES.get(name, name): archive[name] for name in archive.files}
    except Exception as error:
        raise LogError(str(path), f"not a whole npz file ({error})", "write it again") from error
    if "header" in arrays:
        raise LogError(
            str(path), "the result of a simulation", "read it by SimulationResult.load(path).log()"
        )
    stamps = arrays.get("stamps", arrays.get("t"))
    if stamps is None or "position" not in arrays:
        remedy = 'a log has "stamps" [ns] or "t" [s], "position" and "joint_names"'
        raise LogError(str(path), f"has only {', '.join(sorted(arrays))}", remedy)
    names = tuple(str(name) for name in arrays.get("joint_names", ())) or wanted.joints
    columns = arrays["position"].shape[-1]
    if names is None or len(names) != columns:
        raise LogError(
            str(path), f"{columns} columns without names", f"give joints=, {columns} names"
        )
    kept = {name: np.asarray(arrays[name], dtype=float) for name in CHANNELS if name in arrays}
    for name, array in kept.items():
        shape = (len(stamps), 6 if name == "wrench" else columns)
        if array.shape != shape:
            raise LogError(str(path), f"{name} has shape {array.shape}", f"it is {shape}")
    is_whole = np.issubdtype(stamps.dtype, np.integer)
    return Samples(stamps.astype(np.int64) if is_whole else to_stamps(stamps), names, **kept), ()


def write(path: Path, samples: Samples) -> None:
    """Write samples as an npz file."""
    arrays = dict(samples.channels()) | {
        "stamps": samples.stamps,
        "joint_names": np.array(samples.joint_names),
    }
    with whole_file(path) as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
