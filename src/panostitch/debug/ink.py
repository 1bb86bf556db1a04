"""Colours, letters and sizes of the debug pictures. Pictures are (h, w, 3) uint8 RGB."""

import colorsys
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]
Floats = NDArray[np.float64]

LONGEST = 1600  # px, longest side of any picture: opens at once and still shows a key point

WHITE: Colour = (255, 255, 255)
BLACK: Colour = (0, 0, 0)
PAPER: Colour = (38, 40, 44)  # ground of diagrams and captions
GREY: Colour = (150, 150, 150)
GREEN: Colour = (0, 158, 115)
VERMILLION: Colour = (213, 94, 0)
_RIM: Colour = (14, 14, 16)
YELLOW: Colour = (240, 228, 66)
SKY: Colour = (86, 180, 233)

# Okabe and Ito 2008, told apart by people with any of the common colour blindnesses; without black
_HUES: tuple[Colour, ...] = (
    (0, 114, 178), (230, 159, 0), (0, 158, 115), (204, 121, 167), (86, 180, 233), (213, 94, 0), (240, 228, 66),
)  # fmt: skip
# further rounds keep the hues and change what colour-blind people see best, the lightness: (share, of white or black)
_ROUNDS = ((0.0, 255), (0.5, 255), (0.42, 0), (0.72, 255), (0.62, 0), (0.28, 255), (0.22, 0), (0.61, 255), (0.52, 0))

LETTERS = 18  # px, usual height of a line of text
_LINE = 26  # px from line to line
_NARROWEST = 480  # px, so that a caption can be read
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_FONT_HEIGHT = 30.0  # px of a line of that font at scale 1
_FIXED_BITS = 4  # binary places of the coordinates that OpenCV draws with


def colour(index: int) -> Colour:
    """Colour of the photo or group with this index; 63 different ones, then again from the start."""
    share, towards = _ROUNDS[index // len(_HUES) % len(_ROUNDS)]
    red, green, blue = (round(v + share * (towards - v)) for v in _HUES[index % len(_HUES)])
    return red, green, blue


def along(share: float) -> Colour:
    """Colour for a place along a scale of 0..1: from blue over magenta to yellow, getting lighter all the way."""
    share = min(max(share, 0.0), 1.0)
    hue = 0.58 + 0.58 * share
    red, green, blue = colorsys.hls_to_rgb(hue % 1.0, 0.45 + 0.2 * share, 0.95)
    return round(255 * red), round(255 * green), round(255 * blue)


def plain(words: str) -> str:
    """The text in the letters that OpenCV can draw: ASCII, others become a question mark."""
    return "".join(c if " " <= c <= "~" else "?" for c in words)


def text_width(words: str, height: int = LETTERS) -> int:
    """Width in px of a line of text."""
    (width, _), _ = cv2.getTextSize(plain(words), _FONT, height / _FONT_HEIGHT, _stroke(height))
    return int(width)


def shorten(words: str, width: float, height: int = LETTERS) -> str:
    """The text, or its beginning and end with dots between, so that it fits into a width in px."""
    words = plain(words)
    if text_width(words, height) <= width:
        return words
    for kept in range(len(words) - 1, 0, -1):
        short = words[: (kept + 1) // 2] + ".." + words[len(words) - kept // 2 :]
        if text_width(short, height) <= width:
            return short
    return ""


def write(
    picture: Picture,
    words: str,
    at: tuple[float, float],
    *,
    height: int = LETTERS,
    ink: Colour = WHITE,
    centred: bool = False,
) -> None:
    """Write a line of text into a picture, with a dark rim; `at` is the left end (or centre), half-way up (x, y) px.

    The rim is grown from the letters: a thicker stroke has other widths in some versions of OpenCV.
    """
    words = plain(words)
    width, pad = text_width(words, height), height
    x, y = round(at[0] - (width / 2 if centred else 0)) - pad, round(at[1]) - pad
    letters = np.zeros((2 * pad + 1, width + 2 * pad), np.uint8)
    foot = (pad, pad + round(0.36 * height))
    cv2.putText(letters, words, foot, _FONT, height / _FONT_HEIGHT, 255, _stroke(height), cv2.LINE_AA)
    # only the part that lies on the picture
    top, left = max(0, -y), max(0, -x)
    place = picture[max(0, y) : max(0, y + letters.shape[0]), max(0, x) : max(0, x + letters.shape[1])]
    letters = letters[top : top + place.shape[0], left : left + place.shape[1]]
    if letters.size:
        rim = cv2.GaussianBlur(cv2.dilate(letters, np.ones((3, 3), np.uint8)), (3, 3), 0)
        for mask, paint in ((rim, _RIM), (letters, ink)):
            share = mask[..., None].astype(np.float32) / 255
            place[:] = to_bytes(place * (1 - share) + np.array(paint, np.float32) * share)


def blank(height: int, width: int, ground: Colour = PAPER) -> Picture:
    """An empty picture; many times quicker than `np.full` with a colour."""
    picture = np.empty((height, width, 3), np.uint8)
    cv2.rectangle(picture, (0, 0), (width - 1, height - 1), ground, -1)
    return picture


def captioned(picture: Picture, *lines: str) -> Picture:
    """The picture with lines of text on a dark strip below, reduced so that both fit into LONGEST.

    Small pictures are centred on a wider sheet.
    """
    strip = _LINE * len(lines) + 8
    factor = min(1.0, LONGEST / picture.shape[1], (LONGEST - strip) / picture.shape[0])
    picture = to_bytes(resized(picture, round(picture.shape[1] * factor), round(picture.shape[0] * factor)))
    height, width = picture.shape[:2]
    sheet = blank(height + strip, max(width, _NARROWEST))
    left = (sheet.shape[1] - width) // 2
    sheet[:height, left : left + width] = picture
    for number, line in enumerate(lines):
        write(sheet, shorten(line, sheet.shape[1] - 20), (10, height + 18 + _LINE * number))
    return sheet


def resized(picture: NDArray[Any], width: int, height: int, *, exact: bool = False) -> NDArray[Any]:
    """An array (h, w[, 3]) at another size; `exact` keeps values unmixed, as labels need it."""
    size = (max(1, width), max(1, height))
    if size == (picture.shape[1], picture.shape[0]):
        return picture
    smooth = cv2.INTER_AREA if size[0] <= picture.shape[1] else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST if exact else smooth))


def fit(picture: NDArray[Any], longest: int = LONGEST, *, exact: bool = False) -> NDArray[Any]:
    """An array (h, w[, 3]) reduced, if it must be, to a longest side in px."""
    height, width = picture.shape[:2]
    factor = min(1.0, longest / max(height, width))
    return resized(picture, round(width * factor), round(height * factor), exact=exact)


def to_bytes(pixels: NDArray[Any]) -> Picture:
    """Numbers of 0..255 as uint8, rounded; what is no number becomes black."""
    if pixels.dtype == np.uint8:
        return np.asarray(pixels, np.uint8)
    return np.asarray(np.clip(np.nan_to_num(np.asarray(pixels, np.float32)) + 0.5, 0, 255), np.uint8)


def fixed(xy: NDArray[np.floating]) -> NDArray[np.int32]:
    """Coordinates (n, 2) px in the fixed-point numbers that `line` and `path` draw with."""
    return np.asarray(np.rint(np.asarray(xy, np.float64) * 2**_FIXED_BITS), np.int32)


def path(picture: Picture, xy: NDArray[np.floating], ink: Colour, thickness: int = 1, *, closed: bool = False) -> None:
    """Draw a line through points (n, 2) px, exact to a sixteenth of a px."""
    cv2.polylines(picture, [fixed(xy).reshape(-1, 1, 2)], closed, ink, thickness, cv2.LINE_AA, _FIXED_BITS)


def filled(picture: Picture, xy: NDArray[np.floating], ink: Colour) -> None:
    """Fill a polygon (n, 2) px."""
    cv2.fillPoly(picture, [fixed(xy).reshape(-1, 1, 2)], ink, cv2.LINE_AA, _FIXED_BITS)


def circle(picture: Picture, at: NDArray[np.floating], radius: float, ink: Colour, thickness: int = 1) -> None:
    """Draw a circle about a point (2,) px; a thickness of -1 fills it."""
    x, y = fixed(at.reshape(1, 2))[0]
    cv2.circle(picture, (int(x), int(y)), round(radius * 2**_FIXED_BITS), ink, thickness, cv2.LINE_AA, _FIXED_BITS)


def _stroke(height: int) -> int:
    return 1 if height < 26 else 2
