#!/usr/bin/env python3
"""Compares `rosarium compare` with the authors' FLIP.

usage: foreign_flip.py PROGRAM FOLDER     (needs the PyPI packages flip-evaluator, OpenEXR and numpy)

Every pair NAME-1.exr, NAME-2.exr and NAME-1.png, NAME-2.png in the folder is compared by both programs; the first is
the reference. Pairs of waves, steps and noise are added. Exit code 1 where a mean differs by more than MEAN, a weighted
median or a largest value by more than PIXEL, or the exposures by more than EXPOSURE stops.

Also prints what `values_of_the_authors_program` in src/validate/flip.rs holds.
"""
import importlib.metadata
import json
import pathlib
import subprocess
import sys

import flip_evaluator
import numpy as np
import OpenEXR

MEAN = 5e-5
PIXEL = 3e-4
EXPOSURE = 1e-3


def write(path, rgb):
    channels = {"RGB": np.ascontiguousarray(rgb, dtype=np.float32)}
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels) as f:
        f.write(str(path))


def light(path):
    with OpenEXR.File(str(path), separate_channels=True) as f:
        channels = f.channels()
        # FLIP is not defined for the negative light that colours beyond sRGB have.
        return np.maximum(np.stack([channels[c].pixels for c in "RGB"], -1), 0).astype(np.float32)


def waves(scale, shift, disc, width=40, height=24):
    """As in the tests of src/validate/flip.rs."""
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    lift = np.where(disc & ((x - 20) ** 2 + (y - 12) ** 2 < 25), np.float32(0.1), np.float32(0))
    phases = [0.5 * x + shift, 0.3 * y - shift, 0.2 * (x + y) + 2 * shift]
    return (np.stack([0.5 + 0.35 * np.sin(p) + lift for p in phases], -1) * scale).astype(np.float32)


def made_pairs(folder):
    rng = np.random.default_rng(1)
    write(folder / "waves-1.exr", waves(1, 0.0, False))
    write(folder / "waves-2.exr", waves(1, 0.1, True))
    write(folder / "bright-1.exr", waves(30, 0.0, False))
    write(folder / "bright-2.exr", waves(30, 0.1, True))
    noise = np.exp(rng.normal(0, 1.5, (70, 101, 3)))
    write(folder / "noise-1.exr", noise)
    write(folder / "noise-2.exr", noise * rng.gamma(4, 0.25, noise.shape))
    steps = np.kron(rng.random((6, 9, 3)), np.ones((11, 13, 1)))
    write(folder / "steps-1.exr", steps)
    write(folder / "steps-2.exr", np.roll(steps, 1, axis=1))


def weighted_median(values):
    values = np.sort(values.ravel().astype(np.float64))
    return values[np.searchsorted(np.cumsum(values), 0.5 * values.sum())]


def theirs(reference, test, ppd):
    if reference.suffix == ".exr":
        pair, kind = (light(reference), light(test)), "HDR"
    else:
        pair, kind = (str(reference), str(test)), "LDR"
    values, _, parameters = flip_evaluator.evaluate(*pair, kind, applyMagma=False, parameters={"ppd": ppd})
    return values, parameters


def ours(program, reference, test, ppd):
    command = [program, "compare", str(test), str(reference), "--json", "--pixels-per-degree", str(ppd)]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["flip"]


def main():
    program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    print("flip-evaluator", importlib.metadata.version("flip-evaluator"))
    made_pairs(folder)
    largest = {"mean": 0.0, "pixel": 0.0, "exposure": 0.0}
    for reference in sorted(folder.glob("*-1.exr")) + sorted(folder.glob("*-1.png")):
        test = reference.with_name(reference.name.replace("-1.", "-2."))
        for ppd in (67.020645, 25.0, 120.0):
            values, parameters = theirs(reference, test, ppd)
            found = ours(program, reference, test, ppd)
            mean = values.mean(dtype=np.float64)
            largest["mean"] = max(largest["mean"], abs(found["mean"] - mean))
            for name, value in (("weighted_median", weighted_median(values)), ("max", values.max())):
                largest["pixel"] = max(largest["pixel"], abs(found[name] - value))
            if found["exposures"]:
                for key, name in (("start_ev", "startExposure"), ("stop_ev", "stopExposure")):
                    largest["exposure"] = max(largest["exposure"], abs(found["exposures"][key] - parameters[name]))
                assert found["exposures"]["count"] == parameters["numExposures"], (reference, found, parameters)
            print(f"{reference.name:16} {ppd:6.1f} ppd: ours {found['mean']:.6f}, theirs {mean:.6f}")
    print("known values: mean, (20, 12), (3, 20)")
    for ppd, scale, kind in ((67.020645, 1, "LDR"), (20.0, 1, "LDR"), (150.0, 1, "LDR"), (67.020645, 30, "HDR")):
        pair = waves(scale, 0.0, False), waves(scale, 0.1, True)
        values, _, _ = flip_evaluator.evaluate(
            *pair, kind, inputsRGB=False, applyMagma=False, parameters={"ppd": ppd})
        print(f"  {kind} {ppd:.1f}: {values.mean(dtype=np.float64):.7f} {values[12, 20, 0]:.7f} {values[20, 3, 0]:.7f}")
    print("largest differences:", ", ".join(f"{k} {v:.1e}" for k, v in largest.items()))
    if largest["mean"] > MEAN or largest["pixel"] > PIXEL or largest["exposure"] > EXPOSURE:
        sys.exit("FAILED: FLIP is not the authors'")


main()
