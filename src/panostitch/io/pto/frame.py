"""The stored pixels of a photo, which Hugin goes by, and the upright ones, which we go by."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image

from panostitch.errors import UsageError
from panostitch.io.deep import DeepFile
from panostitch.io.orientation import TRANSPOSED
from panostitch.io.readers import FileSource
from panostitch.model.camera import Camera
from panostitch.model.photo import Photo

Floats = NDArray[np.float64]

MIRRORED = (2, 4, 5, 7)  # EXIF orientations that no turn of a camera makes upright


@dataclass(frozen=True)
class Frame:
    """size: (width, height) px as stored; stored_from_upright: (3, 3), sends pixels (x, y, 1) to pixels."""

    size: tuple[int, int]
    stored_from_upright: Floats

    def stored(self, xy: Floats) -> Floats:
        """Upright pixels (n, 2) to stored ones."""
        return _moved(self.stored_from_upright, xy)

    def upright(self, xy: Floats) -> Floats:
        """Stored pixels (n, 2) to upright ones."""
        return _moved(self._back, xy)

    def stored_camera(self, camera: Camera) -> Camera:
        """The camera of the stored pixels for that of the upright ones."""
        return _turned(camera, self.stored_from_upright, self.size)

    def upright_camera(self, camera: Camera, size: tuple[int, int]) -> Camera:
        """The camera of the upright photo, of this size, for that of the stored pixels."""
        return _turned(camera, self._back, size)

    @property
    def _back(self) -> Floats:
        return np.asarray(np.rint(np.linalg.inv(self.stored_from_upright)), np.float64)


def frame_of(photo: Photo) -> Frame:
    """How the pixels of a photo lie in its file. Raises UsageError where they are mirrored there."""
    orientation = _orientation(photo)
    if orientation in MIRRORED:
        raise UsageError(
            f"{photo.path}: is stored mirrored (EXIF orientation {orientation}), which Hugin cannot undo",
            hint="save the photo upright, and align anew",
        )
    width, height = photo.size
    size = (height, width) if orientation in TRANSPOSED else photo.size
    turns = {
        1: [[1, 0, 0], [0, 1, 0]],
        3: [[-1, 0, width - 1], [0, -1, height - 1]],
        6: [[0, 1, 0], [-1, 0, width - 1]],
        8: [[0, -1, height - 1], [1, 0, 0]],
    }
    return Frame(size, np.array([*turns[orientation], [0, 0, 1]], np.float64))


def _orientation(photo: Photo) -> int:
    """EXIF orientation 1 to 8 that makes the stored pixels upright."""
    source = photo.deep or photo.source
    if not isinstance(source, FileSource | DeepFile) or source.orientation != 1:
        return getattr(source, "orientation", 1)
    # a TIFF is turned by those who decode it, which is why its source has no turn of its own; Hugin does not
    with Image.open(source.path) as image:
        tag = image.getexif().get(ExifTags.Base.Orientation) if image.format == "TIFF" else 1
    return int(tag or 1) if tag in range(1, 9) else 1


def _moved(matrix: Floats, xy: Floats) -> Floats:
    return np.asarray(xy @ matrix[:2, :2].T + matrix[:2, 2])


def _turned(camera: Camera, new_from_old: Floats, size: tuple[int, int]) -> Camera:
    x, y = _moved(new_from_old, np.array(camera.centre))
    turn = new_from_old.copy()
    turn[:2, 2] = 0
    return replace(camera, size=size, centre=(float(x), float(y)), cam_from_world=turn @ camera.cam_from_world)
