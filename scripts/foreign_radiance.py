"""Checks BSDF XML files in the folder argv[1] with Radiance's own programs (PyPI pyradiance).

Files: sheet_FORM.xml (Lambertian 0.4 + highlight 0.1, transmission 0.3, at 650 nm; half of that at 450 nm) and
mirror_, retro_, side_, straight_FORM.xml (one narrow lobe each); FORM is klems, klems_half, klems_quarter, ttree, ttree4.
Each file is read in a process of its own: the reader keeps files by their path and its `free` must not be called.
"""
import math
import os
import subprocess
import sys

FORMS = ["klems", "klems_half", "klems_quarter", "ttree", "ttree4"]
# Azimuth of the lobe for light from azimuth 30; patch's width about 50 degrees from the normal.
LOBES = {"mirror": 210, "retro": 30, "side": 120, "straight": 210}
WIDTH_DEG = {"klems": 15, "klems_half": 18, "klems_quarter": 30, "ttree": 10, "ttree4": 15}
# Relative: what the width of the incident patch does to the total at an angle that is not its middle.
TOTALS = {"klems": 0.005, "klems_half": 0.015, "klems_quarter": 0.02, "ttree": 0.01, "ttree4": 0.02}


def sheet_total(theta_deg):
    """Reflectance and transmittance of the sheet in white light over those at 650 nm, by a midpoint rule."""
    theta, total, n = math.radians(theta_deg), 0.0, 400
    mirror = (-math.sin(theta), 0.0, math.cos(theta))
    for i in range(n):
        s2 = (i + 0.5) / n
        s, c = math.sqrt(s2), math.sqrt(1 - s2)
        for j in range(n):
            p = 2 * math.pi * (j + 0.5) / n
            cos = max(0.0, mirror[0] * s * math.cos(p) + mirror[2] * c)
            total += (0.4 / math.pi + 0.1 * 6 / (2 * math.pi) * cos**4) * math.pi / n / n
    return total, 0.3


def white_share():
    """CIE-Y under D65 of the sheet over its value at 650 nm: 0.5 up to 450 nm, 1 from 650 nm, linear between."""
    here = os.path.dirname(os.path.abspath(__file__))

    def table(name, column):
        rows = [r.split(",") for r in open(f"{here}/../data/{name}") if r[:1].isdigit()]
        return {float(r[0]): float(r[column]) for r in rows}

    observer, d65 = table("cie_1931_2deg.csv", 2), table("cie_d65.csv", 1)
    weights = {nm: observer[nm] * d65[nm] for nm in observer if nm in d65}
    seen = sum(w * (0.5 + 0.5 * min(max((nm - 450) / 200, 0), 1)) for nm, w in weights.items())
    return seen / sum(weights.values())


def one(path):
    import pyradiance.bsdf as bsdf

    form = os.path.basename(path)[:-4].split("_", 1)[1]
    kind = os.path.basename(path).split("_", 1)[0]
    data = bsdf.load_file(path)
    if kind == "sheet":
        parts = bsdf.SAMPLE_SP | bsdf.SAMPLE_DF
        ratios = []
        for theta in (0, 30, 60):
            known = sheet_total(theta)
            for side in (theta, 180 - theta):
                for flag, exact in zip((bsdf.SAMPLE_R, bsdf.SAMPLE_T), known):
                    ratios.append(bsdf.direct_hemi(data, side, 33, parts | flag) / exact)
        spread = max(abs(r / white_share() - 1) for r in ratios)
        assert spread < TOTALS[form], (path, ratios, white_share())
        return f"{form}: totals within {100 * spread:.2f} %"
    through = kind == "straight"
    for theta_in in (50, 130):
        theta_out = 180 - theta_in if through else theta_in
        values = [(bsdf.query(data, theta_in, 30, theta_out, phi)[1], phi) for phi in range(0, 360, 3)]
        best = max(values)[0]
        # The middle of the patch that holds the peak.
        x = sum(math.cos(math.radians(p)) for v, p in values if v > 0.999 * best)
        y = sum(math.sin(math.radians(p)) for v, p in values if v > 0.999 * best)
        off = (math.degrees(math.atan2(y, x)) - LOBES[kind] + 180) % 360 - 180
        assert abs(off) <= WIDTH_DEG[form], (path, theta_in, off)
    return f"{form}: the {kind} lobe is in its place"


def main(folder):
    files = sorted(f"{folder}/{kind}_{form}.xml" for kind in ["sheet", *LOBES] for form in FORMS)
    files = [f for f in files if os.path.exists(f)]
    assert files, f"no files in {folder}"
    for path in files:
        done = subprocess.run([sys.executable, __file__, "--one", path], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, f"{path}: {done.returncode}\n{done.stderr}"
        print(done.stdout.strip())
    import pyradiance

    package = os.path.dirname(pyradiance.__file__)
    environment = {**os.environ, "RAYPATH": f"{package}/lib:."}
    for path in (f for f in files if "/sheet_" in f):
        # checkBSDF does not find files by a path that begins with anything but "." or "/".
        command = [f"{package}/bin/checkBSDF", os.path.abspath(path)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)
        rows = [line.split() for line in done.stdout.splitlines() if line.startswith(("Interior Refl", "Exterior Refl", "Transmission"))]
        errors = [float(row[-1]) for row in rows if "deg" not in row]
        assert done.returncode == 0 and len(errors) == 3, done.stdout + done.stderr
        # A rank 3 tree has other boxes for the incident than for the exitant direction.
        assert max(errors) < (8 if path.endswith("_ttree.xml") else 0.5), (path, errors)
    print(f"{len(files)} files passed, 0 failed")


if __name__ == "__main__":
    if sys.argv[1] == "--one":
        print(one(sys.argv[2]))
    else:
        main(sys.argv[1])
