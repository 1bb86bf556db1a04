"""What part of the sphere a panorama shows, in words that viewers know: Google's Photo Sphere XMP.

https://developers.google.com/streetview/spherical-metadata
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from panostitch.model.panorama import Panorama

AGREE = np.cos(np.deg2rad(15))  # compasses of phones are off by some 10 degrees; beyond, they say nothing
PACKET = """<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/">
 <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <rdf:Description rdf:about="" xmlns:GPano="http://ns.google.com/photos/1.0/panorama/"
{properties}/>
 </rdf:RDF>
</x:xmpmeta>
<?xpacket end="r"?>"""

PROPERTY = re.compile(r"""GPano:(\w+)\s*=\s*["']([^"'<>]*)["']|<GPano:(\w+)>([^<>]*)</GPano:""")


@dataclass(frozen=True)
class Sphere:
    """What part of a sphere a file says that it shows.

    field:   degrees across and down; None where the file does not say
    whole:   (width, height) px of the whole sphere; None where the file does not say
    heading: degrees from true north of the middle of the picture; None where unknown
    """

    projection: str
    field: tuple[float, float] | None = None
    whole: tuple[int, int] | None = None
    heading: float | None = None


def read_sphere(xmp: bytes, size: tuple[int, int]) -> Sphere | None:
    """What the XMP packet of a picture of `size` px says; None where it says nothing of a sphere."""
    found = PROPERTY.findall(xmp.decode("utf-8", "replace"))
    said = {name or other: (value or text).strip() for name, value, other, text in found}
    if not said.get("ProjectionType"):
        return None
    width, height = (_number(said.get(f"FullPano{side}Pixels")) for side in ("Width", "Height"))
    heading = _number(said.get("PoseHeadingDegrees"))
    if not width or not height:
        return Sphere(said["ProjectionType"], heading=heading)
    # the picture may have been scaled since: what it was then counts
    then = [_number(said.get(f"CroppedAreaImage{side}Pixels")) for side in ("Width", "Height")]
    across, down = (now if then is None else then for now, then in zip(size, then, strict=True))
    field = (min(360 * across / width, 360.0), min(180 * down / height, 180.0))
    return Sphere(said["ProjectionType"], field, (int(width), int(height)), heading)


def _number(text: str | None) -> float | None:
    try:
        number = float(text or "")
    except ValueError:
        return None
    return number if math.isfinite(number) and 0 <= number < 1e9 else None


def sphere_xmp(panorama: Panorama, headings: Sequence[float | None], software: str) -> bytes:
    """The XMP packet of an equirectangular panorama; empty for all others.

    Viewers take every picture with these properties for equirectangular, so that a cylindrical one gets none.
    """
    canvas, crop, alignment = panorama.canvas, panorama.plan.crop, panorama.alignment
    if alignment is None or alignment.model != "rotation" or canvas.projection != "equirectangular":
        return b""
    width = max(crop.width, round(2 * np.pi * canvas.scale))
    height = max(crop.height, round(width / 2))
    # the picture's upper edge from the zenith, by the pixel-centre rule
    top = round(np.pi / 2 * canvas.scale + crop.y - 0.5 + canvas.origin[1])
    properties = {
        "UsePanoramaViewer": "True",
        "ProjectionType": "equirectangular",
        "StitchingSoftware": software,
        "SourcePhotosCount": len(alignment.photos),
        "FullPanoWidthPixels": width,
        "FullPanoHeightPixels": height,
        "CroppedAreaImageWidthPixels": crop.width,
        "CroppedAreaImageHeightPixels": crop.height,
        # in a viewer, the middle of the picture lies straight ahead
        "CroppedAreaLeftPixels": (width - crop.width) // 2,
        "CroppedAreaTopPixels": min(max(top, 0), height - crop.height),
    }
    heading = _heading(panorama, headings)
    if heading is not None:
        properties["PoseHeadingDegrees"] = f"{heading:.1f}"
    lines = (f'    GPano:{name}="{value}"' for name, value in properties.items())
    return PACKET.format(properties="\n".join(lines)).encode()


def _heading(panorama: Panorama, headings: Sequence[float | None]) -> float | None:
    """Degrees from true north of the middle of the picture; None unless the photos agree on it."""
    assert panorama.alignment is not None
    norths = []
    for camera, heading in zip(panorama.alignment.cameras, headings, strict=True):
        if heading is not None:
            ahead = camera.cam_from_world[2]
            norths.append(np.deg2rad(heading) - np.arctan2(ahead[0], ahead[2]))
    mean = np.exp(1j * np.array(norths)).mean() if norths else 0.0
    if abs(mean) < AGREE:
        return None
    crop, canvas = panorama.plan.crop, panorama.canvas
    middle = (crop.x + (crop.width - 1) / 2 + canvas.origin[0]) / canvas.scale
    return float(round(np.rad2deg(np.angle(mean) + middle) % 360, 1) % 360)
