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
        "cube",
    ] = option(
        "auto",
        "How directions become pixels; auto goes by the field of view. Straight lines: rectilinear; wide with straight "
        "verticals: panini, cylindrical; all around: equirectangular, or six faces for viewers: cube; looking down on "
        "it: little-planet.",
    )
    panini_distance: float = option(
        1.0,
        "How far behind the cylinder's axis panini looks at it: 0 is rectilinear, more squeezes the sides more.",
        min=0.0,
        max=10.0,
    )
    scale: float = option(1.0, "Size of the panorama; 1 keeps the photos' own resolution.", min=0.001, max=4.0)
    size: str | None = option(
        None, "Pixels of the picture that is written, instead of a scale: W, xH, or WxH, into which it then fits."
    )
    fov: str | None = option(
        None, "Degrees that the canvas shows about straight ahead: H across, or HxV across and down (360x180)."
    )
    crop: str = option(
        "auto",
        "Largest rectangle without empty corners (full), the whole canvas (none), the rectangle unless it loses much "
        "(auto; all of the field of view that was asked for), or X,Y,W,H in pixels of the whole canvas.",
    )
    yaw: float = option(0.0, "Turn the view to the right, in degrees.", min=-360.0, max=360.0)
    pitch: float = option(0.0, "Turn the view up, in degrees.", min=-90.0, max=90.0)
    roll: float = option(0.0, "Turn the view, not the picture, clockwise, in degrees.", min=-360.0, max=360.0)
    center_on: str | None = option(None, "Name of the photo that is to be in the middle, before any turn.")

    @property
    def sides(self) -> tuple[int | None, int | None] | None:
        """Width and height (px) into which the picture is to fit. Raises UsageError where `size` makes no sense."""
        if self.size is None:
            return None
        found = re.fullmatch(r"(\d{1,7})|(\d{0,7})[xX](\d{1,7})", self.size.strip())
        width, height = (int(n) if n else None for n in (found[1] or found[2], found[3])) if found else (0, 0)
        if width == 0 or height == 0:
            raise UsageError(f"--size {self.size} is no size", hint="write it as 4000, x2000 or 4000x2000, in pixels")
        if self.scale != type(self).scale or self.window is not None:
            other = "--crop X,Y,W,H" if self.window else "--scale"
            raise UsageError(f"--size and {other} both say how large the picture is", hint="leave one of them out")
        return width, height

    @property
    def field(self) -> tuple[float, float | None] | None:
        """Degrees across and down that are to be shown. Raises UsageError where `fov` makes no sense."""
        if self.fov is None:
            return None
        number = r"(\d+(?:\.\d*)?|\.\d+)"
        found = re.fullmatch(rf"{number}(?:[xX]{number})?", self.fov.strip())
        across, down = (float(found[1]), float(found[2]) if found[2] else None) if found else (0.0, None)
        if not 0 < across <= 360 or (down is not None and not 0 < down <= 360):
            raise UsageError(f"--fov {self.fov} is no field of view", hint="write it as 120 or 120x60, in degrees")
        return across, down

    @property
    def cube(self) -> bool:
        """Whether the faces of a cube are asked for. Raises UsageError where another option does not go with that."""
        if self.projection != "cube":
            return False
        if self.fov is not None:
            raise UsageError("--fov: a cube shows all directions", hint="leave it out, or use another --projection")
        if self.crop == "full":
            raise UsageError("--crop full: a cube is whole", hint="leave it out; what no photo shows stays empty")
        return True

    @property
    def window(self) -> tuple[int, int, int, int] | None:
        """x, y, width and height (px of the canvas) to keep; None for a rule. Raises UsageError for neither."""
        if self.crop in ("auto", "full", "none"):
            return None
        found = re.fullmatch(r"(\d{1,9}),(\d{1,9}),(\d{1,9}),(\d{1,9})", self.crop.replace(" ", ""))
        if not found or not (int(found[3]) and int(found[4])):
            raise UsageError(
                f"--crop {self.crop}: neither auto, full, none nor a rectangle",
                hint="write a rectangle as X,Y,W,H: 0,200,4000,1500",
            )
        return int(found[1]), int(found[2]), int(found[3]), int(found[4])


@dataclass(frozen=True)
class CompositingOptions:
    """Stage 4b: from cameras to pixels."""

    exposure: Literal["auto", "gain", "channels", "none"] = option(
        "auto",
        "Equal brightness where photos overlap: one gain for each photo (gain), one for each colour channel against "
        "steps of the white balance (channels), or what pays (auto). Fall-off of the lens is undone where it shows.",
    )
    seams: Literal["graphcut", "dp", "voronoi"] = option(
        "graphcut",
        "Where one photo ends and the next begins: where they agree, around what moved (graphcut), where they agree, "
        "straight through (dp), or half-way (voronoi).",
    )
    blender: Literal["multiband", "feather", "none"] = option("multiband", "How photos are joined at the seams.")
    interpolation: Literal["cubic", "linear", "lanczos", "nearest"] = option(
        "cubic", "How photos are sampled. cubic: keeps detail; lanczos: slower, hardly sharper; linear: quick, softer."
    )
    bands: int | None = option(
        None,
        "Number of bands of multiband, each blended over twice the width of the one before, 0 for hard seams; else as "
        "many as the smallest photo is wide.",
        min=0,
        max=16,
    )


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

    depth: Literal["auto", "8", "16"] = option(
        "auto", "Bits of a channel; auto: 16 where a photo has 16 and the format (.tif, .png) can hold them."
    )
    metadata: Literal["carry", "none"] = option(
        "carry",
        "EXIF on which the photos agree, and for viewers what part of the sphere it shows (carry); or nothing but the "
        "colour profile (none).",
    )
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

    def check(self) -> None:
        """Raise UsageError where the text of an option does not say what it should, or options contradict."""
        _ = self.layout.sides, self.layout.field, self.layout.window, self.layout.cube, self.output.memory

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
