"""What is photographed: a picture on a sphere around the camera, or on a plane in front of it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

# textures and cameras belong to the scenes' front door
from panostitch.synthetic.gallery import gallery_texture as gallery_texture
from panostitch.synthetic.plans import FLAT_PLANS as FLAT_PLANS
from panostitch.synthetic.plans import PLANS as PLANS
from panostitch.synthetic.rig import rig as rig
from panostitch.synthetic.rig import step_for_overlap as step_for_overlap
from panostitch.synthetic.textures import procedural_texture as procedural_texture

Floats = NDArray[np.float64]
Texture = NDArray[np.uint8] | NDArray[np.float32]


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
