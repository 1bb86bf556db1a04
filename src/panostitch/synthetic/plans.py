"""Plans: sets of cameras whose photos form a panorama, each a difficulty of its own. All photos are 1200 x 900."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from panostitch.model.camera import Camera
from panostitch.synthetic.rig import rig, step_for_overlap, view_of_plane

SIZE = (1200, 900)  # px
SEED = 5  # of the unsteady hand that holds the cameras of the large plans


def pair() -> list[Camera]:
    """Two photos with about half of each in common."""
    hfov = np.deg2rad(55)
    half = step_for_overlap(0.5, hfov) / 2
    return rig([-half, half], np.deg2rad([1.0, -1.5]), np.deg2rad([0.5, -1.0]), size=SIZE, hfov=hfov)


def row() -> list[Camera]:
    """Six photos side by side, about 35 % overlap, held almost level."""
    hfov = np.deg2rad(55)
    yaws = (np.arange(6) - 2.5) * step_for_overlap(0.35, hfov)
    pitches, rolls = [0.8, -1.2, 1.5, -0.4, 1.0, -0.9], [0.5, -0.7, 1.1, 0.2, -1.2, 0.6]
    return rig(yaws, np.deg2rad(pitches), np.deg2rad(rolls), size=SIZE, hfov=hfov)


def rolled() -> list[Camera]:
    """Four photos with the camera tilted sideways by up to 30 degrees and once by a quarter turn."""
    hfov = np.deg2rad(60)
    yaws = (np.arange(4) - 1.5) * step_for_overlap(0.5, hfov)
    pitches, rolls = [3.0, -4.0, 2.0, 5.0], [-12.0, 18.0, 90.0, 30.0]
    return rig(yaws, np.deg2rad(pitches), np.deg2rad(rolls), size=SIZE, hfov=hfov)


def low_overlap() -> list[Camera]:
    """Three photos that have only about 15 % of their width in common."""
    hfov = np.deg2rad(55)
    yaws = np.array([-1, 0, 1]) * step_for_overlap(0.15, hfov)
    return rig(yaws, np.deg2rad([1.0, -1.0, 0.5]), np.deg2rad([0.6, 0.0, -0.8]), size=SIZE, hfov=hfov)


def barrel() -> list[Camera]:
    """Four photos through a lens with clear barrel distortion."""
    hfov = np.deg2rad(65)
    yaws = (np.arange(4) - 1.5) * step_for_overlap(0.4, hfov)
    pitches, rolls = [1.0, -2.0, 1.5, -1.0], [0.5, -0.5, 1.0, 0.0]
    return rig(yaws, np.deg2rad(pitches), np.deg2rad(rolls), size=SIZE, hfov=hfov, k1=-0.12, k2=0.02)


def zoomed() -> list[Camera]:
    """Five photos side by side; between them the photographer zooms by up to 1.6 times."""
    yaws = np.deg2rad(24.0) * (np.arange(5) - 2)
    pitches, rolls = [0.5, -1.0, 1.2, -0.6, 0.8], [0.4, -0.8, 0.0, 0.9, -0.5]
    cameras = rig(yaws, np.deg2rad(pitches), np.deg2rad(rolls), size=SIZE, hfov=np.deg2rad(62))
    factors = (1.0, 1.25, 1.6, 1.4, 1.1)
    return [replace(camera, focal=camera.focal * factor) for camera, factor in zip(cameras, factors, strict=True)]


def ring() -> list[Camera]:
    """Ten photos all the way round; the last one overlaps the first."""
    yaws = np.arange(10) * (2 * np.pi / 10) - np.pi
    pitches, rolls = 1.5 * np.sin(np.arange(10) * 2.4), 1.2 * np.cos(np.arange(10) * 1.7)
    return rig(yaws, np.deg2rad(pitches), np.deg2rad(rolls), size=SIZE, hfov=np.deg2rad(58))


def two_rows() -> list[Camera]:
    """Two rows of four: the upper one looks up, the lower one down."""
    hfov = np.deg2rad(55)
    yaws = (np.arange(4) - 1.5) * step_for_overlap(0.4, hfov)
    pitches = np.deg2rad([13.0, 12.0, 14.0, 13.0, -13.0, -14.0, -12.0, -12.5])
    rolls = np.deg2rad([0.5, -0.8, 0.3, 0.0, -0.4, 0.9, -0.2, 0.6])
    return rig(np.tile(yaws, 2), pitches, rolls, size=SIZE, hfov=hfov)


def mosaic() -> list[Camera]:
    """Five rows of eight, about 35 % overlap both ways; row by row, in loops as one turns a camera by hand."""
    hfov = np.deg2rad(40)
    vfov = 2 * np.arctan(np.tan(hfov / 2) * SIZE[1] / SIZE[0])
    yaws = (np.arange(8) - 3.5) * step_for_overlap(0.35, hfov)
    pitches = (2 - np.arange(5)) * step_for_overlap(0.35, vfov)
    across = np.concatenate([yaws if n % 2 == 0 else yaws[::-1] for n in range(5)])
    shake = np.deg2rad(np.random.default_rng(SEED).uniform(-1, 1, (3, 40)))
    return rig(across + shake[0], np.repeat(pitches, 8) + shake[1], shake[2], size=SIZE, hfov=hfov)


def sphere() -> list[Camera]:
    """Everything: a ring of eight, rings of six that look up and down, the zenith and the nadir."""
    steps = [np.arange(8) * (2 * np.pi / 8), *[np.arange(6) * (2 * np.pi / 6) + np.pi / 12] * 2, np.zeros(2)]
    pitches = np.repeat(np.deg2rad([0.0, 48.0, -48.0, 90.0, -90.0]), [8, 6, 6, 1, 1])
    shake = np.deg2rad(np.random.default_rng(SEED).uniform(-1.5, 1.5, (3, 22)))
    return rig(np.concatenate(steps) + shake[0], pitches + shake[1], shake[2], size=SIZE, hfov=np.deg2rad(75))


def plane_pair() -> list[Camera]:
    """Two photos of a flat subject, from the left and from the right of it."""
    left = view_of_plane(SIZE, focal=1200, at=(-0.75, 0.05, -1.6), turn=(0.33, 0.02, 0.03))
    right = view_of_plane(SIZE, focal=1200, at=(0.8, -0.1, -1.5), turn=(-0.36, -0.05, -0.04))
    return [left, right]


PLANS: dict[str, Callable[[], list[Camera]]] = {
    "pair": pair,
    "row": row,
    "rolled": rolled,
    "low_overlap": low_overlap,
    "barrel": barrel,
    "zoomed": zoomed,
    "ring": ring,
    "two_rows": two_rows,
    "mosaic": mosaic,
    "sphere": sphere,
    "plane_pair": plane_pair,
}

# plans whose cameras look at a plane scene; all others stand inside a sphere
FLAT_PLANS = frozenset({"plane_pair"})
