"""Walks through turbid slabs against adding-doubling (S. Prahl's iadpython).

usage: slabs_against_adding_doubling.py ROSARIUM OUT

Fifty slabs in air, upright light: indices 1.0 to 1.5, albedos 0.2 to 1, optical thicknesses 0.1 to 32, anisotropies 0 to 0.9,
so combined that each value meets different ones of the others. Reflectance and transmittance of `rosarium measure`, on a petal
file whose only layer is [tissue.spongy], must be within 3 standard errors of the walks. Adding-doubling has an error of
its own: the difference between 16 and 24 quadrature points, added in quadrature. Prahl's own limit: with many points his
thinnest layer becomes too thin for the arithmetic, so more points are not better.
"""

import json
import math
import subprocess
import sys

import iadpython

RAYS = "2e5"
# Shares below this count as equal: nothing of them could be seen.
SMALLEST = 2e-5
INDICES = [1.0, 1.1, 1.2, 1.35, 1.5]
ALBEDOS = [0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 0.999, 1.0]
THICKNESSES = [0.1, 0.5, 2.0, 8.0, 32.0]
ANISOTROPIES = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]


def slabs():
    for i, n in enumerate(INDICES):
        for k, albedo in enumerate(ALBEDOS):
            yield n, albedo, THICKNESSES[(2 * i + k) % 5], ANISOTROPIES[(3 * i + 7 * k) % 10]


def walk(program, out, n, albedo, thickness, g):
    path = f"{out}/slab.toml"
    with open(path, "w", encoding="utf-8") as f:
        f.write(f"[tissue.spongy]\nthickness_um = 1000.0\nindex = {n}\nanisotropy = {g}\n")
        f.write(f"scattering_per_mm = {albedo * thickness!r}\nabsorption_per_mm = {(1 - albedo) * thickness!r}\n")
    command = [program, "--quiet", "measure", path, "--incident", "0", "--wavelengths", "550", "--rays", RAYS, "--json"]
    found = json.loads(subprocess.check_output(command, text=True))["incidences"][0]
    return [(found[what], found[f"{what}_se"]) for what in ("reflectance", "transmittance")]


def doubling(points, n, albedo, thickness, g):
    sample = iadpython.Sample(a=albedo, b=thickness, g=g, n=n, quad_pts=points)
    return [float(share) for share in sample.rt()[:2]]


def main(program, out):
    worst, wrong, squares, count = 0.0, 0, 0.0, 0
    for slab in slabs():
        ours = walk(program, out, *slab)
        coarse, fine = doubling(16, *slab), doubling(24, *slab)
        for name, (value, error), c, f in zip("RT", ours, coarse, fine):
            distance = max(abs(value - f) - SMALLEST, 0.0)
            z = distance / max(math.hypot(error, f - c), 1e-12)
            worst, squares, count = max(worst, z), squares + z * z, count + 1
            if not z < 3.0:
                wrong += 1
                print(f"n {slab[0]} albedo {slab[1]} b {slab[2]} g {slab[3]}: {name} {value:.5f} ± {error:.5f}, adding-doubling {f:.5f} ({c:.5f})")
    print(f"50 slabs: {count} totals, largest distance {worst:.2f} standard errors, mean square {squares / count:.2f}, {wrong} beyond 3")
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
