"""ICC profiles (version 2) for the tests: of RGB by primaries and a gamma, of grey by a gamma, by a table."""

import struct

import numpy as np

D50 = (0.9642, 1.0, 0.8249)
# CIE XYZ of the primaries, adapted to D50
SRGB = ((0.43607, 0.22249, 0.01392), (0.38515, 0.71687, 0.09708), (0.14307, 0.06061, 0.71410))
P3 = ((0.51512, 0.24120, -0.00105), (0.29198, 0.69225, 0.04189), (0.15710, 0.06657, 0.78407))


def profile(space, tags, *, pcs=b"XYZ ", kind=b"mntr"):
    """A profile of a colour space (4 bytes) with tags (signature to data)."""
    table, data, start = b"", b"", 128 + 4 + 12 * len(tags)
    for name, content in tags.items():
        table += name + struct.pack(">II", start + len(data), len(content))
        data += content + bytes(-len(content) % 4)
    date = struct.pack(">6H", 2020, 1, 1, 0, 0, 0)
    head = bytes(4) + b"\0\0\0\0" + struct.pack(">I", 0x02400000) + kind + space + pcs + date + b"acsp"
    head = head.ljust(68, b"\0") + xyz(D50)[8:]
    body = head.ljust(128, b"\0") + struct.pack(">I", len(tags)) + table + data
    return struct.pack(">I", len(body)) + body[4:]


def xyz(values):
    return b"XYZ \0\0\0\0" + struct.pack(">3i", *(round(v * 65536) for v in values))


def curve(gamma):
    return b"curv\0\0\0\0" + struct.pack(">IH", 1, round(gamma * 256))


def words(text):
    return b"desc\0\0\0\0" + struct.pack(">I", len(text) + 1) + text.encode() + bytes(79)


def rgb(primaries, gamma=2.2, name="test"):
    tags = {b"desc": words(name), b"wtpt": xyz(D50)}
    for letter, primary in zip((b"r", b"g", b"b"), primaries, strict=True):
        tags |= {letter + b"XYZ": xyz(primary), letter + b"TRC": curve(gamma)}
    return profile(b"RGB ", tags)


def grey(gamma):
    return profile(b"GRAY", {b"desc": words("grey"), b"wtpt": xyz(D50), b"kTRC": curve(gamma)})


def table(space, corners):
    """A profile that reads colours from the corners (2, ..., 2, 3) of a table, whose entries are L (0..1), a and b."""
    lab = np.rint(np.clip(np.asarray(corners, float) * [255, 1, 1] + [0, 128, 128], 0, 255)).astype(np.uint8)
    channels, identity = lab.ndim - 1, np.arange(256, dtype=np.uint8).tobytes()
    matrix = struct.pack(">9i", *(65536 * (n % 4 == 0) for n in range(9)))
    lut = b"mft1\0\0\0\0" + bytes([channels, 3, 2, 0]) + matrix + identity * channels + lab.tobytes() + identity * 3
    return profile(space, {b"desc": words("table"), b"wtpt": xyz(D50), b"A2B0": lut}, pcs=b"Lab ", kind=b"scnr")
