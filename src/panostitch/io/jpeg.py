"""JPEG strip by strip: one scan, with a restart marker after each strip (ITU-T T.81, B.2.1 and E.1.4).

OpenCV and Pillow want the whole picture. But nothing after a restart depends on what came before it: strips that were
encoded each by itself, on any thread, are together what an encoder makes of the whole.
"""

import io
import struct
from typing import IO

import cv2
import numpy as np
from PIL import Image

from panostitch.io.embed import Embedded
from panostitch.io.encode import encoded
from panostitch.io.rendering import STRIP, Rendering, Samples
from panostitch.model.canvas import Region

UNIT = 16  # px, side of what is encoded at once, as colours have half the resolution
FRAME, RESTART, START, END, SCAN, INTERVAL, APPLICATION = 0xC0, 0xD0, 0xD8, 0xD9, 0xDA, 0xDD, range(0xE0, 0xF0)
Segments = list[tuple[int, bytes]]  # markers, and what follows each but its length


def write_jpeg(file: IO[bytes], path: str, picture: Rendering, quality: int, own: Embedded) -> None:
    """Write a picture of three channels. Raises OutputError."""
    wanted = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420]

    def work(strip: Samples, _: Samples) -> tuple[Segments, bytes]:
        bgr = np.asarray(cv2.cvtColor(strip, cv2.COLOR_RGB2BGR), np.uint8)
        return _parted(encoded(path, ".jpg", bgr, wanted).tobytes())

    for count, (head, scan) in enumerate(picture.strips(work)):
        before = _marker(RESTART + (count - 1) % 8) if count else _head(head, picture.crop, own)
        file.write(before + scan)
    file.write(_marker(END))


def _parted(data: bytes) -> tuple[Segments, bytes]:
    """The segments of a JPEG with one scan, and what the scan holds."""
    segments, place = Segments(), 2
    while not segments or segments[-1][0] != SCAN:
        kind, length = struct.unpack_from(">xBH", data, place)
        segments.append((kind, data[place + 4 : place + 2 + length]))
        place += 2 + length
    return segments, data[place:-2]


def _head(strip: Segments, crop: Region, own: Embedded) -> bytes:
    """What comes before the scan of the whole picture, made of what comes before that of a strip, and metadata."""
    told = io.BytesIO()
    exif = own.exif.tobytes() if own.exif else b""
    Image.new("RGB", (1, 1)).save(told, "JPEG", exif=exif, icc_profile=own.profile, xmp=own.xmp)
    segments = [segment for segment in _parted(told.getvalue())[0] if segment[0] in APPLICATION]
    for kind, content in strip:
        if kind == FRAME:
            segments.append((kind, content[:1] + struct.pack(">HH", crop.height, crop.width) + content[5:]))
        elif kind not in APPLICATION:
            segments.append((kind, content))
    units = -(-crop.width // UNIT) * (STRIP // UNIT)
    segments.insert(-1, (INTERVAL, struct.pack(">H", units)))
    return _marker(START) + b"".join(
        _marker(kind) + struct.pack(">H", 2 + len(content)) + content for kind, content in segments
    )


def _marker(kind: int) -> bytes:
    return bytes((0xFF, kind))
