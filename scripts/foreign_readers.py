"""Checks files in the folder argv[1] with OpenEXR's library and trimesh."""
import sys

import numpy as np
import OpenEXR
import trimesh

folder = sys.argv[1]
# A denoised picture keeps the film's own light beside the smooth one.
for name, beauty, variance in (("no-denoise", "", "variance"), ("denoise", "noisy.", "noisy_variance")):
    with OpenEXR.File(f"{folder}/{name}.exr", separate_channels=True) as f:
        header, channels = f.header(), f.channels()
        low, high = (np.asarray(v).tolist() for v in header["dataWindow"])
        assert (low, high) == ([12, 0], [47, 15]), (low, high)
        low, high = (np.asarray(v).tolist() for v in header["displayWindow"])
        assert (low, high) == ([0, 0], [47, 31]), (low, high)
        wanted = "R G B A direct.R indirect.G albedo.B N.X Z uv.U petal_id organ_id samples".split()
        for channel in [*wanted, f"{beauty}R", f"{variance}.R"]:
            assert channel in channels, f"{name}.exr: channel {channel} is missing from {sorted(channels)}"
            assert channels[channel].pixels.shape == (16, 36), channel
        seen = channels[f"{beauty}R"].pixels
        for light in (channels["R"].pixels, seen):
            assert np.isfinite(light).all() and light.max() > 0, name
        parts = channels["direct.R"].pixels + channels["indirect.R"].pixels
        assert np.allclose(seen, parts, rtol=1e-5, atol=1e-6), name
        for key in ("chromaticities", "seed", "spp", "sceneHash"):
            assert any(key in k for k in header), f"{name}.exr: attribute {key} is missing from {sorted(header)}"
        assert any("denoiser" in k for k in header) == (name == "denoise"), sorted(header)
counts = {}
for name in ("rose.ply", "rose.obj", "rose.glb"):
    mesh = trimesh.load(f"{folder}/{name}", force="mesh", process=False)
    counts[name] = len(mesh.faces)
    assert np.isfinite(mesh.vertices).all()
assert len(set(counts.values())) == 1 and counts["rose.ply"] > 10_000, counts
cells = trimesh.load(f"{folder}/cells.ply", process=False)
assert abs(cells.bounds[1][2] - 37.0) < 0.1 and cells.bounds[0][2] >= -1e-3, cells.bounds
print("3 passed, 0 failed")
