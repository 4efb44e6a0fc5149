"""The page that shows a scene: one self-contained HTML text that loads nothing from anywhere."""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._meshcat import VIEWER_BUNDLE

_HERE = Path(__file__).parent


def page(scene: dict[str, Any]) -> str:
    """Return the page of a scene.

    Args:
        scene: Plain JSON data and arrays, as player.js describes them.
    """
    fields = {
        "title": html.escape(scene["title"]),
        "style": _text("page.css"),
        "script": _text("player.js"),
        "bundle": _bundle(),
        "scene": _base64(packed(scene)),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda field: fields[field[1]], _text("page.html"))


def packed(scene: dict[str, Any]) -> bytes:
    """Return a scene as bytes: a header's length, the header in JSON, and the arrays that it points into."""
    arrays: list[bytes] = []

    def pointer(value: object) -> object:
        if isinstance(value, bytes):
            value = np.frombuffer(value, np.uint8)
        if isinstance(value, np.generic):
            return value.item()
        if not isinstance(value, np.ndarray):
            raise TypeError(type(value).__name__)
        content, start = _plain(value), sum(map(len, arrays))
        arrays.append(content.tobytes() + bytes(-content.nbytes % 4))
        dtype = f"{content.dtype.kind}{content.dtype.itemsize}"
        return {"dtype": dtype, "start": start, "end": start + content.nbytes}

    header = json.dumps(scene, default=pointer, separators=(",", ":"), allow_nan=False).encode()
    return len(header).to_bytes(4, "little") + header + b"".join(arrays)


def _plain(array: NDArray[Any]) -> NDArray[Any]:
    return array if array.dtype == np.uint8 else array.astype("<f4")


@cache
def _text(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


@cache
def _bundle() -> str:
    return _base64(VIEWER_BUNDLE.read_bytes())


def _base64(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, mtime=0)).decode()
