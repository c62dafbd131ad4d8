"""The paper's three contact problems, with and without detachment: `python examples/02_detachment/run.py --out DIR`.

Prints tables of gradients and of fits over every constant that the paper leaves open, and draws the paper's figures
(loss, parameter, gradient over the iterations). A few minutes on one core. What comes out, and where it departs from
the paper: docs/concepts/detachment.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import billiards
import box
import drone

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the pictures")
    out = parser.parse_args().out
    for toy in (drone, box, billiards):
        toy.main(out)
    print(f"pictures in {out}")
