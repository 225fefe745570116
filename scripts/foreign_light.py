"""Reads the files of `rosarium light` in the folder argv[1] with SciPy, netCDF4, xarray and trimesh."""
import csv
import sys

import netCDF4
import numpy as np
import scipy.io
import trimesh
import xarray

folder = sys.argv[1]
with open(f"{folder}/light.csv") as f:
    rows = list(csv.DictReader(line for line in f if not line.startswith("#")))
data = xarray.open_dataset(f"{folder}/light.nc")
assert dict(data.sizes)["side"] == 2 and data.sizes["group"] * 2 * data.sizes["band"] == len(rows), data.sizes
assert [s.decode().rstrip("\0") if isinstance(s, bytes) else s for s in data["side"].values] == ["adaxial", "abaxial"]
assert data["incident_w_m2"].attrs["units"] == "W m-2"
for name in ("incident_w_m2", "absorbed_w_m2", "transmitted_w_m2", "incident_umol_m2_s", "absorbed_w"):
    ours = np.array([float(r[name]) for r in rows])
    assert np.allclose(ours, data[name].values.ravel(), rtol=1e-6), name
with netCDF4.Dataset(f"{folder}/light.nc") as nc:
    assert nc.data_model == "NETCDF3_64BIT_OFFSET", nc.data_model
    assert "".join(c.decode() for c in nc["organ"][0].data).rstrip("\0") == rows[0]["organ"]
    assert nc.dimensions["sensor"].size == 1 and (nc["sensor_w_m2"][:] > 0).all()
with scipy.io.netcdf_file(f"{folder}/light.nc", mmap=False) as nc:
    area = nc.variables["area_mm2"][:]
    assert np.allclose(area[0], float(rows[0]["area_mm2"]))
# Photons of daylight: about 4.6 umol/J.
assert abs(data["incident_umol_m2_s"].sum() / data["incident_w_m2"].sum() - 4.6) < 0.3

ply = trimesh.load(f"{folder}/baked.ply", process=False)
scene = trimesh.load(f"{folder}/baked.glb", process=False)
colors = np.asarray(ply.visual.vertex_colors)[:, :3]
assert colors.max() > 60 and colors.std() > 5, (colors.max(), colors.std())
parts = list(scene.geometry.values())
assert len(ply.faces) == sum(len(p.faces) for p in parts)
print("light: 4 readers passed, 0 failed")
