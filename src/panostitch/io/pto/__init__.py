"""Hugin's project file (.pto): an alignment for Hugin's programs, and back.

panotools, which Hugin's programs are built on, has cameras like ours (libpano13, `adjust.c`, SetMakeParams): rays are
turned by yaw, pitch and roll, made a plane, scaled by the focal length that the field of view `v` stands for, moved
along the radius by the polynomial of a, b and c, and shifted by d and e px. Pixel (0, 0) is the centre of the top-left
pixel there as well, the middle of a picture is ((w - 1) / 2, (h - 1) / 2), and coordinates are those of the stored
pixels: EXIF orientation is not applied.
"""

from panostitch.io.pto.canvas import check_projection as check_projection
from panostitch.io.pto.reading import read_pto as read_pto
from panostitch.io.pto.writing import Exactness as Exactness
from panostitch.io.pto.writing import check_photos as check_photos
from panostitch.io.pto.writing import write_pto as write_pto

EXTENSION = ".pto"
