"""The eight walls of the gallery: panelling, pilasters, windows, and pictures in frames with a lamp above each.

Only pictures that scikit-image states to be CC0 or in the public domain hang here; all of them ship in its wheel.
"""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

Colours = NDArray[np.floating]
RGB = tuple[float, float, float]

WALLS = 8
APOTHEM = 6.0  # m from the middle of the room to a wall
WALL_WIDTH = 2 * APOTHEM * float(np.tan(np.pi / WALLS))  # m
EYE = 1.6  # m above the floor
CEILING = 2.35  # m above the eye
WALL_HEIGHT = EYE + CEILING
DENSITY = 180  # px per m
LAMP_FROM = 0.8  # m; pictures as high as this have a lamp of their own

CREAM: RGB = (226, 217, 198)
PAINT: tuple[RGB, ...] = ((124, 62, 54), (88, 112, 104), (74, 90, 116), (150, 122, 80))
WOOD: dict[str, RGB] = {"gold": (186, 146, 72), "black": (44, 40, 38), "walnut": (98, 62, 38), "white": (232, 228, 220)}


@dataclass(frozen=True)
class Hanging:
    """A picture on a wall.

    name:   function of `skimage.data`
    x:      m from the middle of the wall to the middle of the picture
    up:     m from eye level to the middle of the picture
    height: m, without its frame
    wood:   which frame
    mat:    m of white card around it
    """

    name: str
    x: float
    up: float
    height: float
    wood: str
    mat: float = 0.0


@dataclass(frozen=True)
class Wall:
    """What is on one wall; a window is (x, width) in m."""

    pictures: tuple[Hanging, ...] = ()
    window: tuple[float, float] | None = None


# clockwise from the wall straight ahead
HALL: tuple[Wall, ...] = (
    Wall(
        (
            Hanging("astronaut", 0.0, 0.45, 1.5, "gold"),
            Hanging("chelsea", -1.56, 0.83, 0.56, "walnut", 0.05),
            Hanging("cell", -1.56, -0.03, 0.6, "black", 0.05),
            Hanging("coffee", 1.56, 0.82, 0.56, "black", 0.05),
            Hanging("text", 1.56, 0.02, 0.36, "walnut", 0.06),
        )
    ),
    Wall((Hanging("retina", -1.76, 0.45, 0.62, "gold"), Hanging("horse", 1.76, 0.45, 0.5, "walnut", 0.04)), (0.0, 2.0)),
    Wall((Hanging("hubble_deep_field", 0.0, 0.45, 1.7, "black", 0.05),)),
    Wall((Hanging("brick", -1.0, 0.42, 1.2, "walnut"), Hanging("gravel", 1.0, 0.42, 1.2, "black"))),
    Wall((Hanging("clock", 0.0, 0.42, 1.4, "gold"),)),
    Wall((Hanging("grass", 0.0, 0.42, 1.5, "white", 0.08),)),
    Wall(
        (Hanging("camera", -1.76, 0.45, 0.62, "black", 0.04), Hanging("microaneurysms", 1.76, 0.45, 0.6, "gold")),
        (0.0, 2.0),
    ),
    Wall((Hanging("rocket", 0.0, 0.45, 1.55, "walnut"),)),
)


def painted_walls(rng: np.random.Generator) -> Colours:
    """All walls side by side (h, 8 w, 4): RGB in 0..255, and how far each pixel is a view out of a window, 0 to 1."""
    return np.concatenate([_wall(wall, PAINT[k % len(PAINT)], rng) for k, wall in enumerate(HALL)], axis=1)


def mottled(height: int, width: int, rng: np.random.Generator, *, coarsest: int = 4, fall: float = 0.75) -> Colours:
    """Noise (height, width) of unit deviation at every scale."""
    total = np.zeros((height, width), np.float32)
    cells, strength = coarsest, 1.0
    while cells < min(height, width):
        lattice = rng.standard_normal((cells, max(2, cells * width // height)), np.float32)
        total += strength * cv2.resize(lattice, (width, height), interpolation=cv2.INTER_CUBIC)
        cells, strength = 2 * cells, strength * fall
    return np.asarray(total / total.std(), np.float32)


def picture(name: str) -> NDArray[np.uint8]:
    """One of scikit-image's pictures (h, w, 3) RGB."""
    from skimage import data

    image = np.asarray(getattr(data, name)())
    if image.dtype == bool:
        image = image.astype(np.uint8) * 215 + 20
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2RGB) if image.ndim == 2 else image[..., :3], np.uint8)


def _px(metres: float) -> int:
    return round(metres * DENSITY)


def _row(up: float) -> int:
    """Row of a height in m above eye level."""
    return _px(CEILING - up)


def _wall(wall: Wall, paint: RGB, rng: np.random.Generator) -> Colours:
    height, width = _px(WALL_HEIGHT), _px(WALL_WIDTH)
    colours = np.empty((height, width, 4), np.float32)
    colours[..., :3] = np.array(paint) * (1 + 0.06 * mottled(height, width, rng, fall=0.92))[..., None]
    colours[..., 3] = 0
    if wall.window:
        _window(colours, *wall.window)
    _panelling(colours, wall.window)
    _edges(colours)
    light = _light(wall, height, width)
    for hanging in wall.pictures:
        _hang(colours, hanging)
    colours[..., :3] *= light[..., None] * (1 + 0.012 * rng.standard_normal((height, width, 1), np.float32))
    return np.clip(colours, 0, [255, 255, 255, 1]).astype(np.float32)


def _light(wall: Wall, height: int, width: int) -> Colours:
    """Brightness (h, w): pools under the lamps, darker in the corners of the room."""
    up = (CEILING - np.arange(height, dtype=np.float32) / DENSITY)[:, None]
    x = (np.arange(width, dtype=np.float32) / DENSITY - WALL_WIDTH / 2)[None]
    light = 0.93 + 0.04 * up + 0.04 * np.cos(x * 1.2)
    for hanging in wall.pictures:
        if hanging.height < LAMP_FROM:
            continue
        reach = 0.55 + 0.45 * hanging.height
        fall = (hanging.up + hanging.height / 2 + 0.1) - up
        light = light + 0.3 * np.exp(-(((x - hanging.x) / reach) ** 2) - (fall / (1.5 * reach) - 0.25) ** 2)
    for distance in (WALL_WIDTH / 2 - np.abs(x), up + EYE, CEILING - up):
        light = light * (1 - 0.2 * np.exp(-distance / 0.2))
    return np.asarray(light, np.float32)


def _bevel(colours: Colours, box: tuple[int, int, int, int], width: int, *, depth: float) -> None:
    """Shade the rim (x0, y0, x1, y1) as if it sloped inwards (depth > 0) or outwards under light from above."""
    x0, y0, x1, y1 = box
    for step in range(width):
        a, b, c, d = x0 + step, y0 + step, x1 - 1 - step, y1 - 1 - step
        swell = np.sin(np.pi * (step + 0.5) / width)
        for rows, columns, tone in (
            (slice(b, b + 1), slice(a, c + 1), 1.0),
            (slice(d, d + 1), slice(a, c + 1), -1.0),
            (slice(b, d + 1), slice(a, a + 1), 0.35),
            (slice(b, d + 1), slice(c, c + 1), -0.35),
        ):
            colours[rows, columns, :3] *= 1 + depth * tone * (0.4 + 0.6 * swell)


def _panelling(colours: Colours, window: tuple[float, float] | None) -> None:
    """Cream panels below a rail, a skirting board, and a cornice of several steps."""
    width = colours.shape[1]
    top, skirting = _row(-0.72), _row(-EYE + 0.16)
    free = colours[top:, :, 3] == 0
    colours[top:, :, :3] = np.where(free[..., None], np.array(CREAM) * 0.93, colours[top:, :, :3])
    sills = [(0, width)]
    if window:
        left, right = (_px(WALL_WIDTH / 2 + window[0] + side * (window[1] / 2 + 0.1)) for side in (-1, 1))
        sills = [(0, left), (right, width)]
    for left, right in sills:
        count = max(1, round((right - left) / _px(0.8)))
        edges = np.linspace(left, right, count + 1).astype(int)
        for a, b in pairwise(edges):
            box = (a + _px(0.08), top + _px(0.1), b - _px(0.08), skirting - _px(0.07))
            _bevel(colours, box, _px(0.03), depth=-0.16)
        colours[top : top + _px(0.06), left:right, :3] = CREAM
        colours[top + _px(0.06) : top + _px(0.085), left:right, :3] *= 0.72
        colours[skirting:, left:right, :3] = np.array(CREAM) * 0.86
        colours[skirting : skirting + _px(0.02), left:right, :3] *= 1.1
    for step, tone in enumerate((1.0, 0.9, 1.04, 0.84, 0.97)):
        colours[_px(0.05 * step) : _px(0.05 * (step + 1)), :, :3] = np.array(CREAM) * tone
    colours[_px(0.25) : _px(0.29), :, :3] *= 0.7


def _edges(colours: Colours) -> None:
    """Half a fluted pilaster at either end of the wall."""
    width = _px(0.2)
    across = np.arange(width) / DENSITY
    flutes = 0.94 + 0.07 * np.sin(across * 2 * np.pi / 0.066)
    rows = slice(_px(0.42), _row(-EYE + 0.24))
    for side in (colours[:, :width], colours[:, ::-1][:, :width]):
        side[_px(0.25) :, :, :3] = np.array(CREAM) * 0.96
        side[rows, :, :3] *= flutes[None, :, None]
        side[:, -_px(0.012) :, :3] *= 0.7
        for y in (0.30, 0.40, WALL_HEIGHT - 0.26):
            side[_px(y) : _px(y + 0.02), :, :3] *= 0.75


def _window(colours: Colours, x: float, width: float) -> None:
    """A French window with a round arch, glazing bars and a cream frame."""
    centre, half = _px(WALL_WIDTH / 2 + x), _px(width / 2)
    spring, bottom = _row(0.75), _row(-EYE + 0.05)
    hole = np.zeros(colours.shape[:2], np.float32)
    cv2.rectangle(hole, (centre - half, spring), (centre + half, bottom), 1.0, cv2.FILLED)
    cv2.circle(hole, (centre, spring), half, 1.0, cv2.FILLED, cv2.LINE_8)
    casing = cv2.dilate(hole, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _px(0.12) + 1,) * 2))
    shadow = cv2.GaussianBlur(casing, (0, 0), _px(0.06))
    colours[..., :3] *= (1 - 0.35 * shadow)[..., None]
    lit = cv2.GaussianBlur(casing, (0, 0), _px(0.03)) * 0.14 + 0.9
    soft = cv2.GaussianBlur(casing, (0, 0), 0.8)[..., None]
    colours[..., :3] += soft * (np.array(CREAM) * lit[..., None] - colours[..., :3])
    bar = _px(0.045)
    for offset in (-half, -half // 2, 0, half // 2, half):
        thick = bar if offset == 0 else bar // 2 + 1
        cv2.line(hole, (centre + offset, 0), (centre + offset, bottom), 0.0, thick)
    for up, thick in ((-EYE + 0.07, bar), (-0.85, bar // 2), (-0.05, bar // 2), (0.75, bar)):
        cv2.line(hole, (centre - half, _row(up)), (centre + half, _row(up)), 0.0, thick)
    colours[..., 3] = cv2.GaussianBlur(hole, (0, 0), 0.7)


def _hang(colours: Colours, hanging: Hanging) -> None:
    """Shadow, frame, card, picture, lamp and label."""
    image = picture(hanging.name)
    tall = _px(hanging.height)
    wide = round(tall * image.shape[1] / image.shape[0])
    rim, mat = _px(0.055 + 0.03 * hanging.height), _px(hanging.mat)
    x0, y0 = _px(WALL_WIDTH / 2 + hanging.x) - wide // 2, _row(hanging.up) - tall // 2
    a, b = x0 - mat - rim, y0 - mat - rim
    c, d = x0 + wide + mat + rim, y0 + tall + mat + rim
    shadow = np.zeros(colours.shape[:2], np.float32)
    shadow[b + _px(0.05) : d + _px(0.07), a - _px(0.01) : c + _px(0.01)] = 1
    colours[..., :3] *= (1 - 0.5 * cv2.GaussianBlur(shadow, (0, 0), _px(0.035)))[..., None]
    colours[b:d, a:c, :3] = WOOD[hanging.wood]
    _bevel(colours, (a, b, c, d), rim * 2 // 3, depth=0.28)
    inner = (a + rim * 2 // 3, b + rim * 2 // 3, c - rim * 2 // 3, d - rim * 2 // 3)
    _bevel(colours, inner, rim - rim * 2 // 3, depth=-0.3)
    colours[b + rim : d - rim, a + rim : c - rim, :3] = (238, 234, 224)
    if mat:
        _bevel(colours, (x0 - 3, y0 - 3, x0 + wide + 3, y0 + tall + 3), 3, depth=-0.18)
    small = cv2.resize(image, (wide, tall), interpolation=cv2.INTER_AREA)
    colours[y0 : y0 + tall, x0 : x0 + wide, :3] = small
    colours[y0 : y0 + _px(0.02), x0 : x0 + wide, :3] *= 0.75
    if hanging.height > LAMP_FROM:
        _lamp_and_label(colours, (a + c) // 2, b, c, d)


def _lamp_and_label(colours: Colours, middle: int, top: int, right: int, bottom: int) -> None:
    """A brass lamp above a large picture, and a printed card beside it."""
    half, y = _px(0.22), top - _px(0.13)
    colours[y : top + 2, middle - 2 : middle + 2, :3] = (120, 92, 44)
    colours[y : y + _px(0.05), middle - half : middle + half, :3] = (196, 156, 84)
    colours[y : y + _px(0.015), middle - half : middle + half, :3] = (244, 214, 150)
    colours[y + _px(0.04) : y + _px(0.05), middle - half : middle + half, :3] = (255, 246, 214)
    x, y = right + _px(0.08), bottom - _px(0.14)
    colours[y : y + _px(0.1), x : x + _px(0.13), :3] = (236, 232, 222)
    for line, length in enumerate((0.09, 0.07, 0.1)):
        rows = slice(y + _px(0.02 + 0.025 * line), y + _px(0.02 + 0.025 * line) + 2)
        colours[rows, x + _px(0.015) : x + _px(length), :3] = (92, 88, 82)
