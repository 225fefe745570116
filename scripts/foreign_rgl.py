#!/usr/bin/env python3
"""Reads RGL .bsdf files with Mitsuba's `measured` material and checks them.

usage: foreign_rgl.py FOLDER     (needs the PyPI packages mitsuba and numpy)

For every NAME.bsdf in the folder: it loads, and its reflectance at 0, 30, 60, 75 and 85 degrees is printed, per band.
Where NAME.csv lies beside it (columns wi, wo, wavelength_nm, source_per_sr, reader_per_sr) Mitsuba's values are compared
with those of the table that was written and of Rosarium's reader. Exit code 1 where one is out of its tolerance.
"""
import pathlib
import sys

import numpy as np

READER = 1e-3  # largest difference of f cos to our reader, of the largest f cos
SOURCE_MEAN = 1e-2  # mean difference of f cos to the table, of the mean f cos
REFLECTANCE = 2e-3  # relative, at 0, 30 and 60 deg


def material(path):
    import mitsuba as mi
    if mi.variant() != "scalar_spectral":
        mi.set_variant("scalar_spectral")
    return mi, mi.load_dict({"type": "measured", "filename": str(path)})


def f_cos(mi, bsdf, wi, wo, wavelengths):
    """Mitsuba's eval: the BRDF times the cosine of wo, at up to four wavelengths in nm."""
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(*[float(x) for x in wi])
    four = (list(wavelengths) + [wavelengths[-1]] * 4)[:4]
    si.wavelengths = mi.Color0f() if mi.is_monochromatic else four
    value = bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*[float(x) for x in wo]))
    return [float(value[i]) for i in range(len(wavelengths[:4]))]


def reflectance(mi, bsdf, theta_deg, wavelengths, n=(64, 96)):
    """Product rule: Gauss points in sin^2 theta, even azimuths."""
    nodes, weights = np.polynomial.legendre.leggauss(n[0])
    wi = (np.sin(np.radians(theta_deg)), 0.0, np.cos(np.radians(theta_deg)))
    total = np.zeros(len(wavelengths))
    for s2, weight in zip((nodes + 1) / 2, weights / 2):
        sin, cos = np.sqrt(s2), np.sqrt(1 - s2)
        for p in range(n[1]):
            phi = 2 * np.pi * (p + 0.5) / n[1]
            wo = (sin * np.cos(phi), sin * np.sin(phi), cos)
            # cos dw = d(sin^2 theta) / 2 d phi, and eval has the cosine already.
            total += np.array(f_cos(mi, bsdf, wi, wo, wavelengths)) / cos * weight / 2 * 2 * np.pi / n[1]
    return total


def sampled_reflectance(mi, bsdf, theta_deg, wavelength, n=20000):
    """The mean weight of Mitsuba's own samples, and its standard error."""
    rng = np.random.default_rng(1)
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(float(np.sin(np.radians(theta_deg))), 0.0, float(np.cos(np.radians(theta_deg))))
    si.wavelengths = [wavelength] * 4
    context = mi.BSDFContext()
    weights = np.zeros(n)
    for i, (a, b, c) in enumerate(rng.random((n, 3))):
        _, weight = bsdf.sample(context, si, float(a), mi.Point2f(float(b), float(c)))
        weights[i] = weight[0]
    return weights.mean(), weights.std() / np.sqrt(n)


def wavelengths_of(path):
    from mitsuba.python import tensor_io
    return [float(x) for x in np.atleast_1d(tensor_io.read(str(path))["wavelengths"])]


def compare(mi, bsdf, csv):
    """Mitsuba against the table and against our reader, in units of the largest and mean f cos."""
    rows = np.genfromtxt(csv, delimiter=",", skip_header=1)
    theirs = np.array([f_cos(mi, bsdf, r[0:3], r[3:6], [r[6]])[0] for r in rows])
    cos = rows[:, 5]
    reader = rows[:, 8] * cos
    print(f"  reader: largest difference {np.abs(theirs - reader).max() / reader.max():.2e}")
    ok = np.abs(theirs - reader).max() <= READER * reader.max()
    if not np.isnan(rows[:, 7]).any():
        source = rows[:, 7] * cos
        mean = np.abs(theirs - source).mean() / source.mean()
        print(f"  table:  mean difference {mean:.2e}, largest {np.abs(theirs - source).max() / source.max():.2e}"
              f" of the largest value; negative values down to {theirs.min():.1e}")
        ok &= mean <= SOURCE_MEAN
    return ok


def check_rgl(folder, expected=None):
    """Checks every file of a folder; `expected` maps a file's name to its reflectance (a constant) per band."""
    ok = True
    for path in sorted(pathlib.Path(folder).glob("*.bsdf")):
        mi, bsdf = material(path)
        wavelengths = wavelengths_of(path)[:4]
        print(f"{path.name}: {path.stat().st_size / 1e6:.1f} MB, {wavelengths} nm")
        for theta_deg in [0, 30, 60, 75, 85]:
            total = reflectance(mi, bsdf, theta_deg, wavelengths)
            mean, error = sampled_reflectance(mi, bsdf, theta_deg, wavelengths[-1])
            print(f"  {theta_deg:2d} deg: {np.round(total, 5)}; sampled {mean:.4f} +- {error:.4f}")
            if expected and path.stem in expected and theta_deg <= 60:
                ok &= bool(np.all(np.abs(total / np.array(expected[path.stem]) - 1) <= REFLECTANCE))
        csv = path.with_suffix(".csv")
        if csv.exists():
            ok &= bool(compare(mi, bsdf, csv))
    return ok


if __name__ == "__main__":
    passed = check_rgl(sys.argv[1], {"lambert": [0.1, 0.2]})
    print("ok" if passed else "FAILED")
    sys.exit(0 if passed else 1)
