"""Write the bundled demo scan: python examples/make_sample.py examples/data/bracket.ply"""

import sys
from pathlib import Path

from n2n.cli.demo import OFFSET
from n2n.geometry.shapes import scan

POINTS, NOISE, SEED = 20_000, 0.007, 20

if __name__ == "__main__":
    target = Path(sys.argv[1])
    points = scan("bracket", POINTS, NOISE, SEED) + OFFSET
    # Single precision resolves 0.03 micrometres here and halves the file.
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n" + "".join(
        f"property float {axis}\n" for axis in "xyz"
    )
    target.write_bytes((header + "end_header\n").encode() + points.astype("<f4").tobytes())
