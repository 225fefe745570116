"""Compares `rosarium fit` with SciPy's least_squares and lmfit: the same residuals, the same start.

argv: the program, a folder for files. Values and standard errors must agree to 1e-5 relative; the times of both are
printed, not judged.
"""
import json
import subprocess
import sys
import time

import lmfit
import numpy as np
from scipy.optimize import least_squares

PROGRAM, FOLDER = sys.argv[1], sys.argv[2]
TOLERANCE = 1e-5


def direction(theta_deg, phi_deg):
    t, p = np.radians(theta_deg), np.radians(phi_deg)
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)


def power_lobe(cosine, n):
    return (n + 2) / (2 * np.pi) * np.clip(cosine, 0, None) ** n


def lambert_phong(p, wi, wo):
    kd, ks, n = p
    mirror = wi * [-1, -1, 1]
    return kd / np.pi + ks * power_lobe(np.sum(mirror * wo, axis=1), n)


def lambert(p, wi, wo):
    return np.full(len(wi), p[0] / np.pi)


MODELS = {
    "lambert": (lambert, ["kd"], [0.35], [0.3], ([0], [1])),
    "lambert+phong": (lambert_phong, ["kd", "ks", "n"], [0.25, 0.12, 17.0], [0.3, 0.1, 10.0], ([0, 0, 0.5], [1, 1, 500])),
}


def table(name, model, truth, noise):
    """160 readings: lamp at 20 to 50 degrees, 40 view directions each; sigma is the true noise."""
    rng = np.random.default_rng(7)
    rows = [
        (ti, to, po)
        for ti in (20, 30, 40, 50)
        for po in (0, 45, 90, 135, 180)
        for to in (5, 15, 25, 35, 45, 55, 65, 75)
    ]
    ti, to, po = np.array(rows, dtype=float).T
    wi, wo = direction(ti, np.zeros_like(ti)), direction(to, po)
    clean = model(truth, wi, wo)
    sigma = noise * clean
    y = clean + sigma * rng.standard_normal(len(clean))
    path = f"{FOLDER}/{name.replace('+', '_')}.csv"
    with open(path, "w") as f:
        f.write("incident_theta_deg,theta_deg,phi_deg,bsdf_per_sr,sigma\n")
        for row in zip(ti, to, po, y, sigma):
            f.write(",".join(repr(float(v)) for v in row) + "\n")
    return path, wi, wo, y, sigma


def ours(path, name, names, start, bounds, loss):
    arguments = [PROGRAM, "fit", path, "--model", name, "--json", "--starts", "1", "--intervals", "0", "--weights", "sigma"]
    arguments += ["--columns", "incident_theta=incident_theta_deg,theta=theta_deg,phi=phi_deg,value=bsdf_per_sr,sigma=sigma"]
    arguments += ["--loss", loss]
    for parameter, value, low, high in zip(names, start, *bounds):
        arguments += ["--start", f"{parameter}={value}", "--bounds", f"{parameter}={low}..{high}"]
    done = subprocess.run(arguments, check=True, capture_output=True, text=True)
    fit = json.loads(done.stdout)["fits"][0]
    found = {p["parameter"]: p for p in fit["parameters"]}
    return fit, [found[n]["value"] for n in names], [found[n]["standard_error"] for n in names]


def check(what, a, b):
    worst = np.max(np.abs(np.asarray(a) / np.asarray(b) - 1))
    print(f"  {what}: largest relative difference {worst:.1e}")
    assert worst < TOLERANCE, (what, a, b)


for name, (model, names, truth, start, bounds) in MODELS.items():
    for noise in (0.01, 0.05):
        path, wi, wo, y, sigma = table(f"{name}_{noise}", model, truth, noise)
        for loss in ("linear", "soft_l1", "huber", "cauchy"):
            print(f"{name}, noise {noise:.0%}, loss {loss}")

            def residual(p):
                return (model(p, wi, wo) - y) / sigma

            began = time.perf_counter()
            theirs = least_squares(residual, start, bounds=bounds, loss=loss, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
            seconds = time.perf_counter() - began
            fit, values, errors = ours(path, name, names, start, bounds, loss)
            check("values", values, theirs.x)
            if loss == "linear":
                check("chi2", fit["chi2"], 2 * theirs.cost)
                covariance = np.linalg.inv(theirs.jac.T @ theirs.jac) * 2 * theirs.cost / (len(y) - len(start))
                check("standard errors against SciPy's Jacobian", errors, np.sqrt(np.diag(covariance)))
                parameters = lmfit.Parameters()
                for n, v, low, high in zip(names, start, *bounds):
                    parameters.add(n, value=v, min=low, max=high)
                found = lmfit.minimize(lambda p: residual([p[n].value for n in names]), parameters, xtol=1e-12, ftol=1e-12)
                check("values against lmfit", values, [found.params[n].value for n in names])
                for ours_, theirs_ in (("aic", found.aic), ("bic", found.bic), ("reduced_chi2", found.redchi)):
                    check(ours_, fit[ours_], theirs_)
            print(f"  SciPy: {1e3 * seconds:.1f} ms")
print("fits agree with SciPy and lmfit")
