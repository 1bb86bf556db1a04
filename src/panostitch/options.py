"""Every option: its one default, its help, its range. A frozen dataclass for each stage.

The command line, the project file and the documentation are derived from these classes; no default is written
anywhere else. Standard library only, so that `panostitch --help` is quick.
"""

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Literal


def option(default: Any, help: str, *, min: float | None = None, max: float | None = None) -> Any:
    """A dataclass field that knows its help text and its range (inclusive)."""
    return field(default=default, metadata={"help": help, "min": min, "max": max})


@dataclass(frozen=True)
class FeatureOptions:
    """Stage 1: key points and their descriptors."""

    detector: Literal["sift", "surf", "orb", "akaze"] = option(
        "sift", "Key points and descriptors. sift: most exact; orb: quickest."
    )
    max_features: int = option(2000, "Key points kept in each photo, spread over it.", min=50, max=100_000)
    work_megapixels: float = option(
        1.0, "Size to which photos are reduced before key points are sought.", min=0.05, max=100.0
    )


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
    seed: int = option(0, "Seed of everything random: RANSAC's samples, FLANN's trees.", min=0, max=2**31 - 1)


@dataclass(frozen=True)
class AlignmentOptions:
    """Stage 3: from matches to cameras."""

    model: Literal["auto", "rotation", "homography"] = option(
        "auto", "Camera turned about one point (rotation), flat subject (homography), or what fits (auto)."
    )
    straighten: Literal["auto", "none"] = option("auto", "Level the horizon, or keep the first photo's axes.")


@dataclass(frozen=True)
class LayoutOptions:
    """Stage 4a: the canvas."""

    projection: Literal["auto", "rectilinear", "cylindrical", "equirectangular"] = option(
        "auto", "How directions become pixels; auto goes by the field of view."
    )
    scale: float = option(1.0, "Size of the panorama; 1 keeps the photos' own resolution.", min=0.001, max=4.0)
    crop: Literal["auto", "full", "none"] = option(
        "auto",
        "Largest rectangle without empty corners (full), the whole canvas (none), "
        "or the rectangle unless it loses much (auto).",
    )


@dataclass(frozen=True)
class CompositingOptions:
    """Stage 4b: from cameras to pixels."""

    exposure: Literal["gain", "none"] = option("gain", "Equal brightness where photos overlap.")
    seams: Literal["graphcut", "voronoi"] = option(
        "graphcut", "Where one photo ends and the next begins: where they agree, or half-way."
    )
    blender: Literal["multiband", "feather", "none"] = option("multiband", "How photos are joined at the seams.")


@dataclass(frozen=True)
class OutputOptions:
    """What is written."""

    quality: int = option(92, "JPEG quality of the panorama.", min=1, max=100)


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
