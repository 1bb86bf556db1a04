"""An eight-sided hall with pictures on its walls, seen from its middle: an equirectangular texture by ray casting."""

from dataclasses import dataclass
from math import cos, pi, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from panostitch.synthetic.gallery_walls import (
    APOTHEM,
    CEILING,
    DENSITY,
    EYE,
    WALL_HEIGHT,
    WALL_WIDTH,
    WALLS,
    Colours,
    mottled,
    painted_walls,
    picture,
)

SEED = 7
FLOOR_DENSITY = 150  # px per m
FLOOR_HALF = 6.6  # m; the corners of the room are 6.5 m away
BAND = 64  # rows of the texture made at once
SAMPLES = 2  # rays per texture px and axis
STANDING = (0.35, -0.2)  # m, x and z of the eye; not quite the middle, so that no two walls are alike

# seat and legs of the benches: (x0, y0, z0), (x1, y1, z1) in m from the middle of the room at eye level, y down
BENCHES = (
    ((-1.0, 1.14, 3.75), (1.0, 1.22, 4.2)),
    ((-0.85, 1.22, 3.82), (-0.75, EYE, 4.13)),
    ((0.75, 1.22, 3.82), (0.85, EYE, 4.13)),
    ((-4.35, 1.14, -0.6), (-3.9, 1.22, 1.2)),
    ((-4.28, 1.22, -0.45), (-3.97, EYE, -0.35)),
    ((-4.28, 1.22, 0.95), (-3.97, EYE, 1.05)),
    ((3.95, 1.14, -0.9), (4.4, 1.22, 0.9)),
    ((4.02, 1.22, -0.75), (4.33, EYE, -0.65)),
    ((4.02, 1.22, 0.65), (4.33, EYE, 0.75)),
)

# tangent of the look down below which no bench is in sight: the feet of the nearest, and some more
STEEPEST_BENCH = 0.6


@dataclass(frozen=True)
class Hall:
    """Everything with a picture on it.

    walls, gloss: (h, 8 w, 4), sharp and as a polished floor mirrors them
    floor:        (n, n, 3) from above
    grass, cloud: tiles for the view out of the windows
    """

    walls: Colours
    gloss: Colours
    floor: Colours
    grass: Colours
    cloud: Colours


def gallery_texture(width: int = 4096) -> NDArray[np.uint8]:
    """The hall as an equirectangular texture (width / 2, width, 3) RGB; the same bytes each time."""
    hall = _hall()
    height = width // 2
    texture = np.empty((height, width, 3), np.uint8)
    for top in range(0, height, BAND):
        rows = min(BAND, height - top)
        latitude = ((np.arange(rows * SAMPLES) + 0.5) / SAMPLES + top) / height * np.pi - np.pi / 2
        longitude = ((np.arange(width * SAMPLES) + 0.5) / SAMPLES / width - 0.5) * 2 * np.pi
        colours = _look(hall, longitude.astype(np.float32)[None], latitude.astype(np.float32)[:, None])
        mean = cv2.resize(colours, (width, rows), interpolation=cv2.INTER_AREA)
        texture[top : top + rows] = np.clip(np.rint(mean), 0, 255)
    return texture


def _hall() -> Hall:
    rng = np.random.default_rng(SEED)
    walls = painted_walls(rng)
    gloss = cv2.GaussianBlur(walls, (0, 0), sigmaX=0.02 * DENSITY, sigmaY=0.09 * DENSITY)
    grass = cv2.GaussianBlur(picture("grass"), (0, 0), 1.0).astype(np.float32) / 128
    cloud = mottled(512, 2048, rng, coarsest=3, fall=0.55)
    return Hall(walls, np.asarray(gloss, np.float32), _floor(rng), grass, cloud)


def _floor(rng: np.random.Generator) -> Colours:
    """Oak boards that run diagonally, with two dark inlays along the walls."""
    size = round(2 * FLOOR_HALF * FLOOR_DENSITY)
    x, z = np.meshgrid(*[(np.arange(size, dtype=np.float32) + 0.5) / FLOOR_DENSITY - FLOOR_HALF] * 2)
    along, across = 0.8 * x + 0.6 * z, 0.8 * z - 0.6 * x
    row = np.floor(across / 0.17).astype(int)
    shift = rng.uniform(0, 2, 200)[row % 200]
    board = np.floor((along + shift) / 1.5).astype(int)
    tone = rng.normal(1.0, 0.11, 4999)[(row * 61 + board * 173) % 4999]
    warmth = rng.normal(0.0, 0.035, 4999)[(row * 211 + board * 37) % 4999]
    grain = mottled(512, 512, rng, coarsest=8, fall=0.9)
    at_x, at_y = (along * 40 + row * 97) % 511, (across * 900 + board * 31) % 511
    tone = tone + 0.06 * cv2.remap(grain, at_x.astype(np.float32), at_y.astype(np.float32), cv2.INTER_LINEAR)
    for distance, length in ((across / 0.17, 0.17), ((along + shift) / 1.5, 1.5)):
        gap = np.abs(distance - np.rint(distance)) * length
        tone = tone * (1 - 0.45 * np.exp(-((gap / 0.006) ** 2)))
    inwards = APOTHEM - _largest_reach(x, z)
    inlay = ((np.abs(inwards - 0.55) < 0.11) | (np.abs(inwards - 0.85) < 0.03))[..., None]
    colour = np.stack([158 * (1 + warmth), 112 + 0 * warmth, 70 * (1 - warmth)], -1)
    return np.asarray(np.where(inlay, [88.0, 56.0, 36.0], colour) * tone[..., None], np.float32)


def _largest_reach(x: Colours, z: Colours) -> Colours:
    """How far points reach out towards the nearest wall, m from the middle."""
    # opposite walls are mirror images
    angles = [2 * pi * k / WALLS for k in range(WALLS // 2)]
    return np.asarray(np.max([np.abs(x * sin(a) + z * cos(a)) for a in angles], axis=0), np.float32)


def _look(hall: Hall, longitude: Colours, latitude: Colours) -> Colours:
    """Colours (h, w, 3) along directions: longitude (1, w) and latitude (h, 1), y down."""
    x, z, slope = np.sin(longitude), np.cos(longitude), np.tan(latitude)
    # horizontal distance to the wall and the place on it depend on the longitude alone
    wall, far, place = _nearest_wall(x[0], z[0])
    y = slope * far
    seen = _on_wall(hall.walls, wall, place, y)
    colours = np.ascontiguousarray(seen[..., :3])
    open_air = np.flatnonzero(seen[..., 3].any(0))
    if len(open_air):
        share = seen[:, open_air, 3:]
        outside = _outside(hall, x[:, open_air], z[:, open_air], slope, longitude[:, open_air])
        colours[:, open_air] += share * (outside - colours[:, open_air])
    if (y < -CEILING).any():
        colours = np.where((y < -CEILING)[..., None], _ceiling(x, z, slope), colours)
    if (y > EYE).any():
        mirrored = _on_wall(hall.gloss, wall, place, 2 * EYE - y)
        colours = np.where((y > EYE)[..., None], _lit_floor(hall, x, z, slope, mirrored), colours)
    if latitude.max() > 0 and slope.min() < STEEPEST_BENCH:
        colours = _with_benches(colours, x, slope, z)
    return np.asarray(colours, np.float32)


def _rgb(*values: float) -> Colours:
    return np.array(values, np.float32)


def _nearest_wall(x: Colours, z: Colours) -> tuple[NDArray[np.intp], Colours, Colours]:
    """For horizontal directions (w,): which wall they meet, at what distance m, and where on it, m from its left."""
    angles = np.arange(WALLS)[:, None] * 2 * np.pi / WALLS
    normal_x, normal_z = np.sin(angles), np.cos(angles)
    towards = x * normal_x + z * normal_z
    left = APOTHEM - STANDING[0] * normal_x - STANDING[1] * normal_z
    distance = np.where(towards > 1e-6, left / np.maximum(towards, 1e-6), np.inf)
    wall = distance.argmin(0)
    far = distance.min(0)
    hit_x, hit_z = STANDING[0] + far * x, STANDING[1] + far * z
    angle = wall * 2 * np.pi / WALLS
    place = hit_x * np.cos(angle) - hit_z * np.sin(angle) + WALL_WIDTH / 2
    return wall, np.asarray(far, np.float32), np.asarray(place, np.float32)


def _on_wall(walls: Colours, wall: NDArray[np.intp], place: Colours, y: Colours) -> Colours:
    """Wall colours (h, w, 4) at places (w,) m and heights y (h, w) m below the eye."""
    each = walls.shape[1] / WALLS
    column = np.clip(place * (each / WALL_WIDTH) - 0.5, 0, each - 1) + wall * each
    row = np.clip((y + CEILING) * (walls.shape[0] / WALL_HEIGHT) - 0.5, 0, walls.shape[0] - 1)
    columns = np.broadcast_to(column, y.shape).astype(np.float32)
    return np.asarray(cv2.remap(walls, columns, row.astype(np.float32), cv2.INTER_LINEAR), np.float32)


def _lit_floor(hall: Hall, x: Colours, z: Colours, slope: Colours, mirrored: Colours) -> Colours:
    """The polished floor (h, w, 3), with shadows under the benches and the walls mirrored in it."""
    far = EYE / np.maximum(slope, 1e-3)
    at_x, at_z = STANDING[0] + far * x, STANDING[1] + far * z
    columns, rows = ((a + FLOOR_HALF) * FLOOR_DENSITY - 0.5 for a in (at_x, at_z))
    colour = cv2.remap(
        hall.floor,
        columns.astype(np.float32),
        rows.astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    inwards = APOTHEM - _largest_reach(at_x, at_z)
    light = (1.12 - 0.025 * np.hypot(at_x, at_z)) * (1 - 0.4 * np.exp(-np.maximum(inwards, 0) / 0.25))
    for (x0, _, z0), (x1, _, z1) in BENCHES[::3]:
        beside = np.hypot(
            *(
                np.maximum(np.abs(a - (lo + hi) / 2) - (hi - lo) / 2, 0)
                for a, lo, hi in ((at_x, x0, x1), (at_z, z0, z1))
            )
        )
        light = light * (1 - 0.45 * np.exp(-((beside / 0.22) ** 2)))
    # Schlick's law with a little more than varnish has, as floors in brochures shine
    grazing = (1 - slope / np.sqrt(1 + slope**2)) ** 3
    share = (0.06 + 0.6 * grazing)[..., None]
    glow = mirrored[..., :3] * (1 - mirrored[..., 3:]) + _rgb(236, 242, 248) * mirrored[..., 3:]
    return np.asarray(colour * light[..., None] * (1 - share) + glow * share, np.float32)


def _ceiling(x: Colours, z: Colours, slope: Colours) -> Colours:
    """Plaster in steps around a glass roof (h, w, 3)."""
    far = CEILING / np.maximum(-slope, 1e-3)
    reach = np.minimum(_largest_reach(STANDING[0] + far * x, STANDING[1] + far * z), 2 * APOTHEM)
    tone = 0.98 - 0.2 * np.exp(-np.maximum(APOTHEM - reach, 0) / 0.3)
    for edge in (2.7, 3.0, 4.2, 5.4):
        tone = (
            tone - 0.13 * np.exp(-(((reach - edge) / 0.04) ** 2)) + 0.05 * np.exp(-(((reach - edge - 0.1) / 0.05) ** 2))
        )
    plaster = _rgb(236, 230, 218) * tone[..., None]
    bars = np.minimum(np.abs(reach % 0.9 - 0.45), 1.0)
    glass = _rgb(222, 234, 246) * (1 - 0.5 * np.exp(-((bars / 0.03) ** 2)))[..., None]
    return np.asarray(np.where((reach < 2.7)[..., None], glass, plaster), np.float32)


def _outside(hall: Hall, x: Colours, z: Colours, slope: Colours, longitude: Colours) -> Colours:
    """The garden: lawn, a hedge on hills, clouds (h, w, 3)."""
    up = -slope
    turn = np.broadcast_to(longitude / (2 * np.pi) + 0.5, np.broadcast_shapes(x.shape, slope.shape))
    cloud_rows = np.broadcast_to(np.clip(up, 0, 2) * 250, turn.shape).astype(np.float32)
    cloud = cv2.remap(hall.cloud, (turn * 2047).astype(np.float32), cloud_rows, cv2.INTER_LINEAR)
    sky = _rgb(196, 218, 240) + np.clip(up, 0, 0.6)[..., None] * _rgb(-150, -90, -15)
    sky = sky + np.clip(cloud, 0, 1.6)[..., None] * (_rgb(252, 252, 252) - sky) * 0.6
    ground = 1.9 / np.maximum(slope, 0.012)
    tile_x, tile_z = ((at % 5) * 102.3 for at in (x * ground, z * ground))
    blades = cv2.remap(hall.grass, tile_x.astype(np.float32), tile_z.astype(np.float32), cv2.INTER_LINEAR)
    near = np.exp(-ground / 9)[..., None]
    lawn = _rgb(104, 136, 70) * (1 + 0.8 * (blades - 1) * near)
    lawn += (1 - near) * _rgb(14, 12, 8)
    hills = 0.10 + 0.035 * np.sin(5 * longitude + 1) + 0.022 * np.sin(13 * longitude) + 0.012 * np.sin(41 * longitude)
    leaves = cv2.remap(hall.cloud, (turn * 40 % 1 * 2047).astype(np.float32), (cloud_rows * 20 % 511), cv2.INTER_LINEAR)
    hedge = _rgb(72, 104, 62) * (1 + 0.2 * leaves)[..., None]
    edge = np.clip((up - hills - 0.012 * leaves) / 0.006, 0, 1)[..., None]
    return np.asarray(np.where(slope[..., None] > 0, lawn, hedge * (1 - edge) + sky * edge), np.float32)


def _with_benches(colours: Colours, x: Colours, y: Colours, z: Colours) -> Colours:
    """Draw the boxes in front of floor and walls; rays are (x, y, z) from where one stands."""
    nearest = np.full(colours.shape[:2], np.inf, np.float32)
    start = (STANDING[0], 0.0, STANDING[1])
    rays = [np.where(np.abs(ray) < 1e-6, 1e-6, ray) for ray in (x, y, z)]
    for low, high in BENCHES:
        near, far = [], []
        for ray, origin, a, b in zip(rays, start, low, high, strict=True):
            first, second = (a - origin) / ray, (b - origin) / ray
            near.append(np.minimum(first, second))
            far.append(np.maximum(first, second))
        enter = np.maximum(np.maximum(near[0], near[1]), near[2])
        leave = np.minimum(np.minimum(far[0], far[1]), far[2])
        hit = (enter < leave) & (enter > 0) & (enter < nearest)
        # the top catches the light, the sides do not
        tone = np.where(np.broadcast_to(near[1], hit.shape) >= enter, 1.25, 0.62)
        leather = _rgb(120, 58, 40) if high[1] < EYE else _rgb(70, 46, 30)
        colours = np.where(hit[..., None], leather * tone[..., None], colours)
        nearest = np.where(hit, enter, nearest)
    return colours
