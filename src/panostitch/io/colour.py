"""Colour profiles: what the numbers of photos mean, and photos brought to one meaning.

By LittleCMS (Pillow's ImageCms), which has 8 bits a channel there: relative colorimetric with black point compensation,
as photo editors do it. What has no profile is taken for sRGB.
"""

import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms

from panostitch.io.deep import InEightBits
from panostitch.model.photo import Photo, Pixels, PixelSource

SRGB = b""  # stands for photos without a profile too
LARGEST = 1 << 20  # bytes; profiles of RGB have 500 to 500,000, those of CMYK are often larger
LARGEST_CMYK = 4 << 20
GREY_MODES = ("1", "L", "LA")
ROWS = 128  # that are converted at once: Pillow's copies of them stay small
STEPS = np.array([0, 8, 24, 64, 128, 192, 255], np.uint8)  # levels of each channel in which profiles are compared
ALIKE = 1  # levels of 8-bit Lab: that much two editions of sRGB differ
LONGEST_NAME = 60
FAILURES = (ImageCms.PyCMSError, OSError, ValueError, TypeError, MemoryError)
DAMAGED = "its colour profile is damaged or not for its colours, which are taken for sRGB"
TOO_DEEP = "its grey profile is not used, which can be done with 8 bits only"


@dataclass(frozen=True)
class Profiles:
    """What the header of a photo says about its colours.

    rgb:    ICC profile of its RGB; empty: sRGB
    device: that of its grey or CMYK, by which they become sRGB; empty where there is none to use
    notes:  what is not as it should be
    """

    rgb: bytes = SRGB
    device: bytes = b""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Converted:
    """The pixels of a photo, converted from its own colour profile to another one."""

    source: PixelSource
    own: bytes
    working: bytes

    def read(self, scale: float = 1.0) -> tuple[Pixels, Pixels | None]:
        """As the photo's own source."""
        pixels, mask = self.source.read(scale)
        transform = _transform(self.own, self.working)
        converted = np.empty_like(pixels)
        for row in range(0, len(pixels), ROWS):
            part = np.ascontiguousarray(pixels[row : row + ROWS])
            converted[row : row + ROWS] = np.asarray(transform.apply(Image.fromarray(part)), np.uint8)
        return converted, mask


def read_profiles(image: Image.Image, *, deep: bool) -> Profiles:
    """The usable colour profile of an opened picture, whose pixels may have 16 bits a channel (`deep`)."""
    profile = image.info.get("icc_profile")
    if not profile:
        return Profiles()
    space = _space(profile)
    if space == b"RGB " and image.mode != "CMYK" and _appearance(profile) is not None:
        return Profiles(rgb=profile)
    if space == b"GRAY" and deep:
        return Profiles(notes=(TOO_DEEP,))
    grey = space == b"GRAY" and image.mode in GREY_MODES
    if (grey or (space == b"CMYK" and image.mode == "CMYK")) and _builds(profile, SRGB, "L" if grey else "CMYK"):
        return Profiles(device=profile)
    return Profiles(notes=(DAMAGED,))


def to_srgb(image: Image.Image, device: bytes) -> Image.Image:
    """A picture of grey or CMYK as sRGB, by its profile."""
    mode = "CMYK" if image.mode == "CMYK" else "L"
    return _transform(device, SRGB, mode).apply(image.convert(mode))


def in_one_profile(photos: Sequence[Photo]) -> tuple[Photo, ...]:
    """The photos with their colours in the profile that most of them have; as they are where they have the same.

    Of two that as many have, the first photo's counts. A photo of 16 bits that is converted has 8 bits.
    """
    profiles = [photo.profile for photo in photos]
    if len(set(profiles)) < 2:
        return tuple(photos)
    working = _working(profiles)
    return tuple(_brought_to(photo, working) for photo in photos)


def conversions(photos: Sequence[Photo]) -> tuple[str, ...]:
    """What is to be said of photos whose colours are converted."""
    changed = [(photo.name, photo.source) for photo in photos if isinstance(photo.source, Converted)]
    if not changed:
        return ()
    name = _name(changed[0][1].working)
    notes = [f"colours of {_named([n for n, _ in changed])} are converted to {name}, the panorama's profile"]
    deep = [n for n, source in changed if isinstance(source.source, InEightBits)]
    if deep:
        notes.append(
            f"to convert colours, {_named(deep)} had to be reduced to 8 bits: give photos of 16 bits one profile first"
        )
    return tuple(notes)


def _working(profiles: Sequence[bytes]) -> bytes:
    """The profile of most photos, those that mean the same counted together, if colours can be brought to it."""
    count = Counter(profiles)
    votes = {own: sum(n for other, n in count.items() if _alike(own, other)) for own in count}
    ranked = sorted(count, key=lambda own: (-votes[own], -count[own]))
    return next((own for own in ranked if _builds(SRGB, own, "RGB")), SRGB)


def _brought_to(photo: Photo, working: bytes) -> Photo:
    if _alike(photo.profile, working):
        return replace(photo, profile=working)
    converted = Converted(photo.source, photo.profile, working)
    return replace(photo, source=converted, deep=None, profile=working)


def _alike(one: bytes, other: bytes) -> bool:
    """Whether two profiles of RGB mean the same, to a level or so."""
    if one == other:
        return True
    a, b = _appearance(one), _appearance(other)
    return a is not None and b is not None and bool((np.abs(a - b) <= ALIKE).all())


@lru_cache(maxsize=64)
def _appearance(profile: bytes) -> NDArray[np.int16] | None:
    """The Lab (n, 3) of some RGB under a profile; None where it does not say."""
    levels = np.stack(np.meshgrid(STEPS, STEPS, STEPS), axis=-1).reshape(1, -1, 3)
    try:
        transform = ImageCms.buildTransform(
            _opened(profile), ImageCms.createProfile("LAB"), "RGB", "LAB", ImageCms.Intent.RELATIVE_COLORIMETRIC
        )
        lab = np.asarray(transform.apply(Image.fromarray(levels)))[0]
    except FAILURES:
        return None
    # Pillow keeps the signs of a and b in its bytes
    return np.column_stack([lab[:, 0], lab[:, 1:].view(np.int8)]).astype(np.int16)


@lru_cache(maxsize=32)
def _transform(own: bytes, working: bytes, mode: str = "RGB") -> ImageCms.ImageCmsTransform:
    """From one profile to another, of RGB. Raises PyCMSError; LittleCMS lets threads share it."""
    return ImageCms.buildTransform(
        _opened(own),
        _opened(working),
        mode,
        "RGB",
        ImageCms.Intent.RELATIVE_COLORIMETRIC,
        ImageCms.Flags.BLACKPOINTCOMPENSATION | ImageCms.Flags.HIGHRESPRECALC,
    )


def _builds(own: bytes, working: bytes, mode: str) -> bool:
    try:
        _transform(own, working, mode)
    except FAILURES:
        return False
    return True


def _opened(profile: bytes) -> ImageCms.ImageCmsProfile:
    created = ImageCms.createProfile("sRGB") if profile == SRGB else io.BytesIO(profile)
    return ImageCms.ImageCmsProfile(created)


def _space(profile: object) -> bytes:
    """The colour space of a profile that is sound as far as its header tells; empty for all others."""
    if not isinstance(profile, bytes) or not 128 < len(profile) <= LARGEST_CMYK:
        return b""
    space = profile[16:20]
    too_large = space != b"CMYK" and len(profile) > LARGEST
    sound = int.from_bytes(profile[:4]) == len(profile) and profile[36:40] == b"acsp"
    return space if sound and not too_large else b""


def _name(profile: bytes) -> str:
    if profile == SRGB:
        return "sRGB"
    try:
        return ImageCms.getProfileDescription(_opened(profile)).strip()[:LONGEST_NAME] or "a profile without a name"
    except FAILURES:
        return "a profile without a name"


def _named(names: Sequence[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
