//! Scenes whose light is known.

use std::f64::consts::PI;

use super::view::ViewSettings;
use super::*;
use crate::film::ToneMap;
use crate::io::light_table::LightTable;
use crate::io::sensors_csv::Sensor;
use crate::scene::{MemoryAssets, SceneDescription, compile, load};
use crate::spectrum::band::LUMENS_PER_WATT;
use crate::transport::NoProgress;
use crate::transport::radiosity::{Quantity, RadiositySettings, solve};

fn scene(text: &str) -> Scene {
    let head = "[film]\nwidth = 24\nheight = 16\n[camera]\nposition_mm = [0, -60, 30]\ntarget_mm = [0, 0, 0]\nfov_deg = 40\n\
                [materials.grey]\ntype = \"lambert\"\nreflectance = 0.5\n\
                [materials.sheet]\ntype = \"diffuse\"\nreflectance_adaxial = 0.3\ntransmittance = 0.2\n";
    let description: SceneDescription = load(&format!("{head}{text}"), "test", &[]).unwrap().description;
    compile(&description, &MemoryAssets::default()).unwrap()
}

const SKY: &str = "[lights.sky]\ntype = \"constant\"\nradiance = 1\nspectrum = { illuminant = \"E\" }\n";
const FLOOR: &str = "[shapes.floor]\ntype = \"quad\"\nwidth_mm = 40\nheight_mm = 40\nmaterial = \"grey\"\n";
const BALL: &str = "[shapes.ball]\ntype = \"sphere\"\nradius_mm = 5\nsubdivisions = 2\nposition_mm = [0, 0, 8]\n\
                    material = \"sheet\"\n";

fn solved(scene: &Scene, grid: &BandGrid) -> Radiosity {
    let settings = RadiositySettings {
        elements: 300,
        rays: 64,
        light_samples: 64,
        residual: 1e-7,
        ..RadiositySettings::default()
    };
    solve(scene, grid.wavelengths_nm(), &settings, &mut Vec::new(), &NoProgress).unwrap()
}

fn thirds() -> BandGrid {
    let bands: Vec<Band> = ["400-700", "400-500"].iter().map(|b| b.parse().unwrap()).collect();
    BandGrid::new(&bands, 50.0).unwrap()
}

#[test]
fn units_scale_light() {
    // A floor under a white sky of radiance 1: irradiance pi at every wavelength, on both sides.
    let s = scene(&format!("{SKY}{FLOOR}"));
    let (grid, unit_lx) = (thirds(), 1000.0);
    let r = solved(&s, &grid);
    let readout = Readout::new(&s, &r, &grid, unit_lx).unwrap();
    let table = readout.table(Per::Organ, Vec::new()).unwrap();
    // W m-2 nm-1 of one: 1000 lx are 1000 / 683 / 106.86 nm.
    let spectral = PI * unit_lx / LUMENS_PER_WATT / 106.857;
    for side in 0..2 {
        let (par, blue) = (table.at(0, side, 0), table.at(0, side, 1));
        assert!((par.incident[0] / (300.0 * spectral) - 1.0).abs() < 1e-2, "{par:?}");
        assert!((blue.incident[0] / (100.0 * spectral) - 1.0).abs() < 1e-2, "{blue:?}");
        assert!((par.absorbed[0] / par.incident[0] - 0.5).abs() < 1e-5 && par.transmitted[0] == 0.0);
        let micromoles = crate::spectrum::band::photons_umol_per_j(550.0);
        assert!((par.incident[1] / par.incident[0] / micromoles - 1.0).abs() < 1e-3);
    }
    assert_eq!(table.groups[0].area_mm2.round(), 1600.0);
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Readout::new(&s, &r, &grid, bad).is_err(), "{bad}");
    }
    assert!(Readout::new(&s, &r, &BandGrid::new(&[Band::PAR], 7.0).unwrap(), 1.0).is_err());
}

#[test]
fn groups_add_up_to_the_ledger() {
    let key = "[lights.key]\ntype = \"area\"\nposition_mm = [20, -20, 40]\ntarget_mm = [0, 0, 0]\nwidth_mm = 10\n\
               radiance = 5\n";
    let s = scene(&format!("{SKY}{key}{FLOOR}{BALL}"));
    let grid = thirds();
    let r = solved(&s, &grid);
    let readout = Readout::new(&s, &r, &grid, 7e4).unwrap();
    let balances = readout.balances();
    let absorbed = |t: &LightTable, band: usize| -> f64 {
        (0..t.groups.len())
            .flat_map(|g| [0, 1].map(|side| t.at(g, side, band).absorbed[0] * t.groups[g].area_mm2 * 1e-6))
            .sum()
    };
    for (per, tolerance) in
        [(Per::Organ, 1e-5), (Per::Shape, 1e-5), (Per::Element, 1e-5), (Per::Triangle, 1e-4)]
    {
        let table = readout.table(per, Vec::new()).unwrap();
        for (b, balance) in balances.iter().enumerate() {
            let ratio = absorbed(&table, b) / balance.absorbed_w();
            assert!((ratio - 1.0).abs() < tolerance, "{per:?}: {ratio}");
        }
        let area: f64 = table.groups.iter().map(|g| g.area_mm2).sum();
        let exact: f64 = s
            .shapes
            .iter()
            .flat_map(|s| (0..s.mesh.triangles.len()).map(|f| f64::from(s.mesh.face_area(f))))
            .sum();
        assert!((area / exact - 1.0).abs() < 1e-3, "{per:?}: {area} {exact}");
        let triangles: usize = s.shapes.iter().map(|s| s.mesh.triangles.len()).sum();
        if per == Per::Triangle {
            assert_eq!(table.groups.len(), triangles);
        }
    }
    assert!(readout.table(Per::Petal, Vec::new()).is_err());
    for b in &balances {
        let sum = b.escaped_directly_w + b.absorbed_w() + b.escaped_w + b.under_way_w + b.error_w;
        assert!((sum / b.emitted_w - 1.0).abs() < 1e-9 && b.closure().abs() < 0.02, "{b:?}");
        let names: Vec<&str> = b.absorbed.iter().map(|a| a.what.as_str()).collect();
        assert_eq!(names, ["shapes.ball", "shapes.floor", "lights.key"]);
    }
}

fn sensor(position: [f64; 3], normal: [f64; 3]) -> Sensor {
    let [x, y, z] = position;
    let [nx, ny, nz] = normal;
    Sensor::new("s".into(), [x, y, z, nx, ny, nz], "s").unwrap()
}

#[test]
fn sensors_in_known_light() {
    let sun = "[lights.sun]\ntype = \"distant\"\nelevation_deg = 30\nirradiance = 4\nspectrum = { illuminant = \"E\" }\n";
    // In the free: a grain of dust is the scene.
    let dust = "[shapes.dust]\ntype = \"sphere\"\nradius_mm = 0.01\nsubdivisions = 1\nposition_mm = [0, 0, -500]\n\
                material = \"grey\"\n";
    let s = scene(&format!("{SKY}{sun}{dust}"));
    let grid = thirds();
    let r = solved(&s, &grid);
    let readout = Readout::new(&s, &r, &grid, lux_of_one()).unwrap();
    let up = sensor([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let down = sensor([0.0, 0.0, 0.0], [0.0, 0.0, -3.0]);
    let readings = readout.sensors(&[up, down], 1024, 1, &NoProgress).unwrap();
    for (reading, exact) in readings.iter().zip([PI + 2.0, PI]) {
        let b = &reading.bands[0];
        let (value, error) = (b.irradiance[0] / 300.0, b.standard_error[0] / 300.0);
        assert!((value - exact).abs() < 4.0 * error + 1e-3 && error < 0.01, "{value} {error} {exact}");
        assert!((b.direct[0] - b.irradiance[0]).abs() < 1e-3 * b.irradiance[0]);
    }
    // Between two wide grey floors, of which the lower one is lit through nothing: E = rho E_floor far from the rim.
    let low = sensor([0.0, 0.0, 0.01], [0.0, 0.0, -1.0]);
    let s = scene(&format!("{SKY}{FLOOR}"));
    let r = solved(&s, &grid);
    let readout = Readout::new(&s, &r, &grid, lux_of_one()).unwrap();
    let b = &readout.sensors(&[low], 256, 1, &NoProgress).unwrap()[0].bands[0];
    assert!(
        (b.irradiance[0] / (0.5 * PI * 300.0) - 1.0).abs() < 0.02 && b.direct[0] < 0.01 * b.irradiance[0]
    );
}

#[test]
fn a_sensor_on_a_surface_reads_its_irradiance() {
    let s = scene(&format!("{SKY}{FLOOR}{BALL}"));
    let grid = thirds();
    let r = solved(&s, &grid);
    let readout = Readout::new(&s, &r, &grid, lux_of_one()).unwrap();
    let floor = s.shapes.iter().position(|s| s.key.contains("floor")).unwrap() as u32;
    let mut compared = 0;
    for (k, e) in r.elements().list().iter().enumerate().filter(|(k, e)| e.shape == floor && k % 29 == 0) {
        let c = e.centre.as_dvec3();
        let at = sensor([c.x, c.y, c.z + 0.01], [0.0, 0.0, 1.0]);
        let reading = readout.sensors(&[at], 1024, k as u64, &NoProgress).unwrap()[0].bands[0];
        let values = r.element(k as u32, Side::Adaxial, Quantity::Incident);
        let exact = readout.flux(0, |i| f64::from(values[i]))[0];
        // The element is an area and was lit by 64 samples, the sensor is a point.
        assert!((reading.irradiance[0] / exact - 1.0).abs() < 0.08, "{} {exact}", reading.irradiance[0]);
        compared += 1;
    }
    assert!(compared > 3, "{compared}");
}

#[test]
fn the_view_shows_the_irradiance() {
    let s = scene(&format!("{SKY}{FLOOR}"));
    let grid = thirds();
    let r = solved(&s, &grid);
    let readout = Readout::new(&s, &r, &grid, lux_of_one()).unwrap();
    let settings =
        ViewSettings { quantity: Quantity::Incident, band: 0, photons: false, max: None, samples: 2 };
    let view = readout.view(&settings, &NoProgress).unwrap();
    assert_eq!((view.width, view.height, view.values.len()), (24, 16, 24 * 16 * 2));
    let seen: Vec<f32> = view.values.iter().copied().filter(|v| !v.is_nan()).collect();
    assert!(seen.len() > 100 && seen.len() < view.values.len(), "{}", seen.len());
    assert!(seen.iter().all(|v| (f64::from(*v) / (PI * 300.0) - 1.0).abs() < 0.05));
    assert!(readout.map(&settings, &NoProgress).unwrap().starts_with(b"\x89PNG"));
    assert!(readout.view(&ViewSettings { band: 9, ..settings }, &NoProgress).is_err());
}

#[test]
fn baked_colours_are_the_light() {
    let s = scene(&format!("{SKY}{FLOOR}"));
    let grid = BandGrid::new(&[Band::VISIBLE], 20.0).unwrap();
    let r = solved(&s, &grid);
    let readout = Readout::new(&s, &r, &grid, 1.0).unwrap();
    let parts = readout.bake(20.0, 0.0, ToneMap::Linear).unwrap();
    assert_eq!(parts.len(), 2);
    assert_eq!(parts[0].name, "shapes.floor_adaxial");
    // Radiance 0.5 of equal energy: luminance 0.5.
    for part in &parts {
        let y: Vec<f32> = part.colors.iter().map(|[r, g, b]| 0.2126 * r + 0.7152 * g + 0.0722 * b).collect();
        let mean = y.iter().sum::<f32>() / y.len() as f32;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        part.mesh.validate("part").unwrap();
        let up = if part.name.ends_with("adaxial") && !part.name.ends_with("abaxial") { 1.0 } else { -1.0 };
        for face in 0..part.mesh.triangles.len() {
            let [a, b, c] = part.mesh.corners(face);
            assert!((b - a).cross(c - a).z * up > 0.0);
        }
        assert!((part.mesh.positions[0].z - 0.05 * up).abs() < 1e-6);
        assert!(part.mesh.triangles.len() > 50, "as fine as the solution");
    }
    assert!(readout.bake(7.0, 0.0, ToneMap::Linear).is_err());
}
