"""What is photographed: a picture on a sphere around the camera, or on a plane in front of it, and sets of cameras."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from panostitch.geometry.rotation import from_angles
from panostitch.model.camera import Camera

# the textures belong to the scenes' front door
from panostitch.synthetic.gallery import gallery_texture as gallery_texture
from panostitch.synthetic.textures import procedural_texture as procedural_texture

Floats = NDArray[np.float64]
Texture = NDArray[np.uint8] | NDArray[np.float32]
Angles = Sequence[float] | NDArray[np.floating] | float


@dataclass(frozen=True)
class Scene:
    """A picture on a surface; what a photo shows depends on the ray alone.

    texture:    (h, w, 3) RGB in 0..255
    shape:      sphere: equirectangular, the middle of the texture lies straight ahead (+z), columns wrap round.
                plane: rays are (x, y, 1); (0, 0) is the middle of the texture, one unit is half its width
    background: RGB that is seen beside the plane
    """

    texture: Texture
    shape: Literal["sphere", "plane"]
    background: tuple[float, float, float] = (128.0, 128.0, 128.0)

    def coordinates(self, rays: Floats) -> Floats:
        """Texture px (n, 2) that rays (n, 3) meet; pixel (0, 0) is the centre of the top-left pixel.

        NaN where a ray goes away from a plane.
        """
        height, width = self.texture.shape[:2]
        x, y, z = np.moveaxis(rays, -1, 0)
        if self.shape == "plane":
            z = np.where(z > 0, z, np.nan)
            return np.column_stack([x / z * width / 2 + (width - 1) / 2, y / z * width / 2 + (height - 1) / 2])
        longitude, latitude = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
        return np.column_stack([(longitude / (2 * np.pi) + 0.5) * width - 0.5, (latitude / np.pi + 0.5) * height - 0.5])

    def patch(self, columns: range, rows: range) -> NDArray[np.float32]:
        """Texture (h, w, 3) float32 of these columns and rows, which may lie outside it.

        A sphere goes on round the back and over the poles, a plane repeats its last pixels.
        """
        height, width = self.texture.shape[:2]
        x, y = np.array(columns), np.array(rows)
        if self.shape == "plane":
            chosen = self.texture[np.clip(y, 0, height - 1)[:, None], np.clip(x, 0, width - 1)]
            return np.asarray(chosen, np.float32)
        over_pole = (y < 0) | (y >= height)
        y = np.where(y < 0, -1 - y, np.where(y >= height, 2 * height - 1 - y, y))
        # on the far side of a pole one looks at the opposite meridian
        x = (x[None] + np.where(over_pole, width // 2, 0)[:, None]) % width
        return np.asarray(self.texture[y[:, None], x], np.float32)


def sphere_scene(texture: Texture) -> Scene:
    """A picture all around: equirectangular, (h, 2 h, 3) RGB."""
    if texture.shape[1] != 2 * texture.shape[0]:
        raise ValueError(f"an equirectangular texture is twice as wide as high, not {texture.shape[1::-1]}")
    return Scene(texture, "sphere")


def plane_scene(texture: Texture, *, background: tuple[float, float, float] = (128.0, 128.0, 128.0)) -> Scene:
    """A flat picture (h, w, 3) RGB on a plain wall."""
    return Scene(texture, "plane", background)


def rig(
    yaws: Angles,
    pitches: Angles = 0.0,
    rolls: Angles = 0.0,
    *,
    size: tuple[int, int],
    focal: float | None = None,
    hfov: float | None = None,
    k1: float = 0.0,
    k2: float = 0.0,
) -> list[Camera]:
    """Cameras turned about one point (radians; see `geometry.rotation.from_angles`), all with the same lens.

    Give `focal` in px or `hfov`, the horizontal field of view in radians before distortion.
    """
    if (focal is None) == (hfov is None):
        raise ValueError("give either focal or hfov")
    length = focal if focal is not None else size[0] / 2 / np.tan((hfov or 0.0) / 2)
    centre = ((size[0] - 1) / 2, (size[1] - 1) / 2)
    angles = np.broadcast_arrays(*(np.atleast_1d(np.asarray(a, np.float64)) for a in (yaws, pitches, rolls)))
    return [
        Camera(size, float(length), centre, from_angles(*(float(a) for a in turn)), k1, k2)
        for turn in zip(*angles, strict=True)
    ]


def step_for_overlap(overlap: float, hfov: float) -> float:
    """Yaw (radians) between level photos that share this part (0 to 1) of their width in each of them."""
    half = hfov / 2
    return float(half + np.arctan((1 - 2 * overlap) * np.tan(half)))


def view_of_plane(
    size: tuple[int, int], *, focal: float, at: tuple[float, float, float], turn: tuple[float, float, float]
) -> Camera:
    """A camera that looks at the plane z = 0 of a flat scene; its rays are then (x, y, 1) on that plane.

    focal: px
    at:    place of the camera; x right, y down, z = -d for d units before the plane
    turn:  yaw, pitch, roll in radians; zero looks straight at it
    """
    intrinsics = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    rotation = from_angles(*turn)
    # the plane's point (x, y, 0) seen from `at`: R ((x, y, 0) - at) = R [e1 e2 -at] (x, y, 1)
    homography = intrinsics @ rotation @ np.column_stack([np.eye(3)[:, :2], -np.array(at)])
    return Camera(size, 1.0, (0.0, 0.0), homography / homography[2, 2])


def pair() -> list[Camera]:
    """Two photos with about half of each in common."""
    hfov = np.deg2rad(55)
    half = step_for_overlap(0.5, hfov) / 2
    return rig([-half, half], np.deg2rad([1.0, -1.5]), np.deg2rad([0.5, -1.0]), size=(800, 600), hfov=hfov)


def row() -> list[Camera]:
    """Six 1200 x 900 photos side by side, about 35 % overlap, held almost level."""
    hfov = np.deg2rad(55)
    yaws = (np.arange(6) - 2.5) * step_for_overlap(0.35, hfov)
    pitches, rolls = [0.8, -1.2, 1.5, -0.4, 1.0, -0.9], [0.5, -0.7, 1.1, 0.2, -1.2, 0.6]
    return rig(yaws, np.deg2rad(pitches), np.deg2rad(rolls), size=(1200, 900), hfov=hfov)


def rolled() -> list[Camera]:
    """Four photos with the camera tilted sideways by up to 30 degrees and once by a quarter turn."""
    hfov = np.deg2rad(60)
    yaws = (np.arange(4) - 1.5) * step_for_overlap(0.5, hfov)
    pitches, rolls = [3.0, -4.0, 2.0, 5.0], [-12.0, 18.0, 90.0, 30.0]
    return rig(yaws, np.deg2rad(pitches), np.deg2rad(rolls), size=(800, 600), hfov=hfov)


def low_overlap() -> list[Camera]:
    """Three photos that have only about 15 % of their width in common."""
    hfov = np.deg2rad(55)
    yaws = np.array([-1, 0, 1]) * step_for_overlap(0.15, hfov)
    return rig(yaws, np.deg2rad([1.0, -1.0, 0.5]), np.deg2rad([0.6, 0.0, -0.8]), size=(1000, 750), hfov=hfov)


def barrel() -> list[Camera]:
    """Four photos through a lens with clear barrel distortion."""
    hfov = np.deg2rad(65)
    yaws = (np.arange(4) - 1.5) * step_for_overlap(0.4, hfov)
    pitches, rolls = [1.0, -2.0, 1.5, -1.0], [0.5, -0.5, 1.0, 0.0]
    return rig(yaws, np.deg2rad(pitches), np.deg2rad(rolls), size=(900, 675), hfov=hfov, k1=-0.12, k2=0.02)


def ring() -> list[Camera]:
    """Ten photos all the way round; the last one overlaps the first."""
    yaws = np.arange(10) * (2 * np.pi / 10) - np.pi
    pitches, rolls = 1.5 * np.sin(np.arange(10) * 2.4), 1.2 * np.cos(np.arange(10) * 1.7)
    return rig(yaws, np.deg2rad(pitches), np.deg2rad(rolls), size=(800, 600), hfov=np.deg2rad(58))


def two_rows() -> list[Camera]:
    """Two rows of four: the upper one looks up, the lower one down."""
    hfov = np.deg2rad(55)
    yaws = (np.arange(4) - 1.5) * step_for_overlap(0.4, hfov)
    pitches = np.deg2rad([13.0, 12.0, 14.0, 13.0, -13.0, -14.0, -12.0, -12.5])
    rolls = np.deg2rad([0.5, -0.8, 0.3, 0.0, -0.4, 0.9, -0.2, 0.6])
    return rig(np.tile(yaws, 2), pitches, rolls, size=(800, 600), hfov=hfov)


def plane_pair() -> list[Camera]:
    """Two photos of a flat subject, from the left and from the right of it."""
    left = view_of_plane((900, 675), focal=900, at=(-0.75, 0.05, -1.6), turn=(0.33, 0.02, 0.03))
    right = view_of_plane((900, 675), focal=900, at=(0.8, -0.1, -1.5), turn=(-0.36, -0.05, -0.04))
    return [left, right]


PLANS: dict[str, Callable[[], list[Camera]]] = {
    "pair": pair,
    "row": row,
    "rolled": rolled,
    "low_overlap": low_overlap,
    "barrel": barrel,
    "ring": ring,
    "two_rows": two_rows,
    "plane_pair": plane_pair,
}

# plans whose cameras look at a plane scene; all others stand inside a sphere
FLAT_PLANS = frozenset({"plane_pair"})
