"""Reads a petal that was measured and converted with Mitsuba and Radiance: its reflectance and transmittance must be those
that the goniophotometer counted.

argv: a folder with totals.json (of `measure --json`, one band) and petal.bsdf, klems.xml, tree.xml (of `convert`).
Tolerances: 0.2 % for the RGL tensor as Mitsuba integrates it, 0.5 % for Klems patches as Radiance integrates them.
"""
import json
import subprocess
import sys

import foreign_rgl

FOLDER = sys.argv[1]


def radiance(path, theta_deg):
    """Reflectance and transmittance by pyradiance, in a process of its own: its reader keeps files and may not be freed."""
    code = (
        "import sys, pyradiance.bsdf as b\n"
        "d = b.load_file(sys.argv[1]); t = float(sys.argv[2])\n"
        "parts = b.SAMPLE_SP | b.SAMPLE_DF\n"
        "print(b.direct_hemi(d, t, 0, parts | b.SAMPLE_R), b.direct_hemi(d, t, 0, parts | b.SAMPLE_T))"
    )
    done = subprocess.run([sys.executable, "-c", code, path, str(theta_deg)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return [float(v) for v in done.stdout.split()]


incidences = json.load(open(f"{FOLDER}/totals.json"))["incidences"]
mi, bsdf = foreign_rgl.material(f"{FOLDER}/petal.bsdf")
wavelengths = foreign_rgl.wavelengths_of(f"{FOLDER}/petal.bsdf")
failed = False
for i in incidences:
    theta = i["incident_deg"]
    wanted = (i["reflectance"], i["transmittance"])
    found = {"Mitsuba": (foreign_rgl.reflectance(mi, bsdf, theta, wavelengths)[0], None)}
    for name in ("klems", "tree"):
        found[name] = radiance(f"{FOLDER}/{name}.xml", theta)
    for name, tolerance in (("Mitsuba", 0.002), ("klems", 0.005), ("tree", 0.02)):
        for what, value, known in zip(("R", "T"), found[name], wanted):
            if value is not None:
                off = value / known - 1
                failed |= abs(off) > tolerance
                print(f"{theta:4.0f} deg {name:8} {what} {value:.5f}, counted {known:.5f}: {100 * off:+.2f} %")
print("FAILED" if failed else "the petal's totals survive")
sys.exit(1 if failed else 0)
