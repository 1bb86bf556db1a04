"""panostitch: overlapping photos to a panorama, through stages you can look into.

The public names are loaded when they are used, so that the command line starts quickly.
"""

import importlib
from typing import Any

_HOMES = {
    "Options": "panostitch.options",
    "align": "panostitch.pipeline",
    "render": "panostitch.pipeline",
    "open_photos": "panostitch.io.readers",
    "write_panorama": "panostitch.io.writers",
    "PanostitchError": "panostitch.errors",
}

__all__ = ["Options", "PanostitchError", "align", "open_photos", "render", "write_panorama"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)
