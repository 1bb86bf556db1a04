"""Every option: its one default, its help, its range. A frozen dataclass for each stage.

The command line, the project file and the documentation are derived from these classes; no default is written
anywhere else. Standard library only, so that `panostitch --help` is quick.
"""

import dataclasses
import re
from dataclasses import dataclass, field
from typing import Any, Literal

from panostitch.errors import UsageError


def option(default: Any, help: str, *, min: float | None = None, max: float | None = None) -> Any:
    """A dataclass field that knows its help text and its range (inclusive)."""
    return field(default=default, metadata={"help": help, "min": min, "max": max})


# What each detector needs: megapixels and key points. SIFT doubles pictures by itself, and needs fewest of its points.
WORK_MEGAPIXELS = {"sift": 0.25, "surf": 1.0, "orb": 1.0, "akaze": 1.0}
MAX_FEATURES = {"sift": 1000, "surf": 2000, "orb": 2000, "akaze": 2000}


def _list(table: dict[str, float] | dict[str, int]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in table.items())


@dataclass(frozen=True)
class FeatureOptions:
    """Stage 1: key points and their descriptors."""

    detector: Literal["sift", "surf", "orb", "akaze"] = option(
        "sift", "Key points and descriptors. sift: most exact; orb: quickest."
    )
    max_features: int | None = option(
        None, f"Key points kept in each photo, spread over it; else {_list(MAX_FEATURES)}.", min=50, max=100_000
    )
    work_megapixels: float | None = option(
        None,
        f"Size to which photos are reduced before key points are sought; else {_list(WORK_MEGAPIXELS)}.",
        min=0.05,
        max=100.0,
    )
    contrast: Literal["own", "local"] = option(
        "own", "Seek key points in the photos as they are (own), or with the contrast evened out everywhere (local)."
    )

    @property
    def megapixels(self) -> float:
        """Size to which photos are reduced: the one that was asked for, or the detector's."""
        return WORK_MEGAPIXELS[self.detector] if self.work_megapixels is None else self.work_megapixels

    @property
    def count(self) -> int:
        """Key points kept in each photo: as many as were asked for, or the detector's."""
        return MAX_FEATURES[self.detector] if self.max_features is None else self.max_features


@dataclass(frozen=True)
class MatchingOptions:
    """Stage 2: which photos see the same thing."""

    matcher: Literal["auto", "brute", "flann"] = option(
        "auto", "Nearest neighbours: exact (brute), indexed (flann), or by their number (auto)."
    )
    ratio: float = option(
        0.8,
        "Lowe's ratio test: keep a match if it is this much nearer than the second best.",
        min=0.1,
        max=1.0,
    )
    ransac_threshold: float = option(
        3.0,
        "Largest error of a true match under the homography, in pixels of the working size.",
        min=0.1,
        max=100.0,
    )
    retries: Literal["auto", "none"] = option(
        "auto", "Search photos that stay alone again: with more pixels, more contrast, another detector (auto)."
    )
    seed: int = option(
        0, "Seed of everything random: RANSAC's samples, FLANN's trees, words of the vocabulary.", min=0, max=2**31 - 1
    )


@dataclass(frozen=True)
class AlignmentOptions:
    """Stage 3: from matches to cameras."""

    model: Literal["auto", "rotation", "similarity", "affine", "homography"] = option(
        "auto",
        "Camera turned about one point (rotation); flat subject: scans (similarity), taken from far away (affine), "
        "from anywhere (homography); or what fits (auto).",
    )
    refine: Literal["full", "none"] = option(
        "full", "Measure control points again on the full photos (full), or take them as key points are (none)."
    )
    straighten: Literal["auto", "none"] = option(
        "auto", "Level the horizon (auto), or leave the view as it was found (none)."
    )
    local_warp: Literal["auto", "none"] = option(
        "auto",
        "Bend each photo a little where the cameras cannot explain what it shows (parallax), if matches that are held "
        "back say that it helps (auto), or never (none).",
    )


@dataclass(frozen=True)
class LayoutOptions:
    """Stage 4a: the canvas."""

    projection: Literal[
        "auto",
        "rectilinear",
        "panini",
        "compressed-rectilinear",
        "cylindrical",
        "mercator",
        "miller",
        "equirectangular",
        "stereographic",
        "little-planet",
        "fisheye",
        "equisolid",
        "transverse-mercator",
    ] = option(
        "auto",
        "How directions become pixels; auto goes by the field of view. Straight lines: rectilinear; wide with straight "
        "verticals: panini, cylindrical; all around: equirectangular; looking down on it: little-planet.",
    )
    panini_distance: float = option(
        1.0,
        "How far behind the cylinder's axis panini looks at it: 0 is rectilinear, more squeezes the sides more.",
        min=0.0,
        max=10.0,
    )
    scale: float = option(1.0, "Size of the panorama; 1 keeps the photos' own resolution.", min=0.001, max=4.0)
    crop: Literal["auto", "full", "none"] = option(
        "auto",
        "Largest rectangle without empty corners (full), the whole canvas (none), "
        "or the rectangle unless it loses much (auto).",
    )
    yaw: float = option(0.0, "Turn the view to the right, in degrees.", min=-360.0, max=360.0)
    pitch: float = option(0.0, "Turn the view up, in degrees.", min=-90.0, max=90.0)
    roll: float = option(0.0, "Turn the view, not the picture, clockwise, in degrees.", min=-360.0, max=360.0)
    center_on: str | None = option(None, "Name of the photo that is to be in the middle, before any turn.")


@dataclass(frozen=True)
class CompositingOptions:
    """Stage 4b: from cameras to pixels."""

    exposure: Literal["auto", "gain", "channels", "none"] = option(
        "auto",
        "Equal brightness where photos overlap: one gain for each photo (gain), one for each colour channel against "
        "steps of the white balance (channels), or what pays (auto). Fall-off of the lens is undone where it shows.",
    )
    seams: Literal["graphcut", "voronoi"] = option(
        "graphcut", "Where one photo ends and the next begins: where they agree, or half-way."
    )
    blender: Literal["multiband", "feather", "none"] = option("multiband", "How photos are joined at the seams.")


UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}


def size_in_bytes(text: str) -> int:
    """The number of bytes in 500M, 1.5G, 2GiB, 800000000. Raises UsageError where there is none."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMGT]?)(?:I?B)?", text.strip().upper())
    if not found:
        raise UsageError(f"{text} is no amount of memory", hint="write it as 500M or 1.5G")
    return int(float(found[1]) * UNITS[found[2]])


@dataclass(frozen=True)
class OutputOptions:
    """What is written."""

    quality: int = option(92, "Quality of a JPEG or WebP panorama.", min=1, max=100)
    compression: Literal["deflate", "none"] = option(
        "deflate", "Of a TIFF: without loss (deflate), or none: several times as quick, twice the size."
    )
    pyramid: Literal["none", "full"] = option(
        "none", "Put smaller copies of itself into a TIFF, each half the one before (full): viewers open it at once."
    )
    max_memory: str | None = option(
        None, "Most memory that rendering may take, 500M or 1.5G: fewer threads, fewer photos kept in memory."
    )

    @property
    def memory(self) -> int | None:
        """Bytes of memory that rendering may take; None without a limit. Raises UsageError where it is no amount."""
        return None if self.max_memory is None else size_in_bytes(self.max_memory)


@dataclass(frozen=True)
class Options:
    """All options, a part for each stage."""

    features: FeatureOptions = FeatureOptions()
    matching: MatchingOptions = MatchingOptions()
    alignment: AlignmentOptions = AlignmentOptions()
    layout: LayoutOptions = LayoutOptions()
    compositing: CompositingOptions = CompositingOptions()
    output: OutputOptions = OutputOptions()

    @classmethod
    def of(cls, **flat: Any) -> "Options":
        """Build from flat names: `Options.of(detector="orb", ratio=0.7)`. Raises TypeError on an unknown name."""
        parts: dict[str, Any] = {}
        for part in dataclasses.fields(cls):
            names = {f.name for f in dataclasses.fields(part.default)}  # type: ignore[arg-type]
            chosen = {name: flat.pop(name) for name in list(flat) if name in names}
            parts[part.name] = dataclasses.replace(part.default, **chosen)  # type: ignore[type-var]
        if flat:
            raise TypeError(f"unknown option: {', '.join(flat)}")
        return cls(**parts)
