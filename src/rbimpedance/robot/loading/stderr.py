"""What native libraries write to file descriptor 2."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def captured_stderr() -> Iterator[Callable[[], str]]:
    """Keep what is written to file descriptor 2 in the block, so that it can become part of an error and not noise.

    Yields:
        A function that returns what was written so far, on one line and without positions in source files.
    """
    try:
        saved = os.dup(2)
    except OSError:  # the process runs without standard error
        yield lambda: ""
        return
    try:
        sink = tempfile.TemporaryFile()  # noqa: SIM115  (closed below)
    except OSError:  # nowhere to write to
        os.close(saved)
        yield lambda: ""
        return
    with sink:
        os.dup2(sink.fileno(), 2)

        def messages() -> str:
            sink.seek(0)
            lines = sink.read(4096).decode(errors="replace").splitlines()
            return " ".join(line.strip() for line in lines if " at line " not in line)

        try:
            yield messages
        finally:
            os.dup2(saved, 2)
            os.close(saved)
