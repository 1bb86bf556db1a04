"""Every tolerance that more than one test file uses: value, unit, reason. Others stand at the top of their file.

Three classes (docs: style, section 6): exact results have none; closed forms are near machine precision; noisy
estimates are about three times the worst value seen over 100 seeds, which is noted beside them.
"""

# Entries of rotations and directions of unit length: some dozen float64 operations of 2e-16 each.
UNIT = 1e-12

# px; coordinates up to 1e4 px that went there and back in float64: 1e4 * 2e-16 * some dozen operations.
PIXEL = 1e-8

# Relative; closed forms of a few operations.
RELATIVE = 1e-9

# Grey levels; what rounding to 8 bits may change.
ROUNDING = 1

# Grey levels, mean over the picture; JPEG of quality 95 without chroma subsampling on a smooth picture: 0.6 seen.
JPEG_MEAN = 2.0
