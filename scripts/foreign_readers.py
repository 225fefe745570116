"""Checks files in the folder argv[1] with OpenEXR's library and trimesh."""
import sys

import numpy as np
import OpenEXR
import trimesh

folder = sys.argv[1]
with OpenEXR.File(f"{folder}/a.exr", separate_channels=True) as f:
    header, channels = f.header(), f.channels()
    low, high = (np.asarray(v).tolist() for v in header["dataWindow"])
    assert (low, high) == ([12, 0], [47, 15]), (low, high)
    low, high = (np.asarray(v).tolist() for v in header["displayWindow"])
    assert (low, high) == ([0, 0], [47, 31]), (low, high)
    for name in "R G B A direct.R indirect.G albedo.B N.X Z uv.U petal_id organ_id samples variance.R".split():
        assert name in channels, f"channel {name} is missing from {sorted(channels)}"
        assert channels[name].pixels.shape == (16, 36), name
    beauty = channels["R"].pixels
    assert np.isfinite(beauty).all() and beauty.max() > 0
    parts = channels["direct.R"].pixels + channels["indirect.R"].pixels
    assert np.allclose(beauty, parts, rtol=1e-5, atol=1e-6)
    for key in ("chromaticities", "seed", "spp", "sceneHash"):
        assert any(key in k for k in header), f"attribute {key} is missing from {sorted(header)}"
counts = {}
for name in ("rose.ply", "rose.obj", "rose.glb"):
    mesh = trimesh.load(f"{folder}/{name}", force="mesh", process=False)
    counts[name] = len(mesh.faces)
    assert np.isfinite(mesh.vertices).all()
assert len(set(counts.values())) == 1 and counts["rose.ply"] > 10_000, counts
cells = trimesh.load(f"{folder}/cells.ply", process=False)
assert abs(cells.bounds[1][2] - 37.0) < 0.1 and cells.bounds[0][2] >= -1e-3, cells.bounds
print("2 passed, 0 failed")
