//! Tables of a petal that nobody measured, for checks of what is made from tables.
//!
//! Model: surface light in a lobe around the lamp above and Lambertian below; interior light in three classes of walks of
//! 5 to 570 um on average, nearly Lambertian, on both sides. Reciprocal by construction, albedo below 0.8.

use std::f64::consts::PI;

use crate::geometry::Side;
use crate::gonio::{AngleGrid, AngularTable, Estimate, Part, PetalOptics, WhiteTotals};

/// Tables of a sheet with a soft lobe towards the lamp at its surface and three classes of walks inside, the short ones rather
/// reflected, the long ones rather transmitted. Symmetric by construction, energy below one.
pub fn sheet(thetas: usize, interior_thetas: usize) -> PetalOptics {
    let surface = AngleGrid { thetas, phis: thetas };
    let interior = AngleGrid { thetas: interior_thetas, phis: interior_thetas };
    let mut optics = PetalOptics {
        sample: "sheet".into(),
        description: "[tissue.adaxial]\npigments = { anthocyanin_ug_per_cm2 = 20.0 }\n[tissue.abaxial]\n"
            .into(),
        version: String::new(),
        walks: 0,
        seed: 0,
        cut_off: 0,
        asymmetry: 0.0,
        class_error: 0.0,
        paths_um: vec![[5.0, 0.0, 0.0, 0.0], [20.0, 60.0, 80.0, 5.0], [40.0, 90.0, 400.0, 40.0]],
        spreads_um: vec![[2.0, 0.0, 0.0, 0.0], [8.0, 20.0, 60.0, 3.0], [20.0, 50.0, 300.0, 20.0]],
        surface: AngularTable::zeros(surface, 1),
        interior: AngularTable::zeros(interior, 3),
        totals: Vec::new(),
    };
    let fill = |table: &mut AngularTable, f: &dyn Fn(Part, f64, f64, f64, usize) -> f64| {
        let AngleGrid { thetas, phis } = table.grid;
        let mut values = Vec::new();
        for part in [Part::Adaxial, Part::Abaxial, Part::Through] {
            for a in 0..thetas {
                for b in 0..thetas {
                    for p in 0..phis {
                        let centre = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
                        let (ta, tb) = (centre(a, thetas) * PI / 2.0, centre(b, thetas) * PI / 2.0);
                        for k in 0..table.classes {
                            values.push(f(part, ta, tb, centre(p, phis) * PI, k) as f32);
                        }
                    }
                }
            }
        }
        table.values = values;
    };
    fill(&mut optics.surface, &|part, a, b, phi, _| {
        let cos = a.sin() * b.sin() * phi.cos() + a.cos() * b.cos();
        match part {
            Part::Adaxial => 0.15 / PI * cos.max(0.0).powi(8) * 2.0,
            Part::Abaxial => 0.04 / PI,
            Part::Through => 0.0,
        }
    });
    fill(&mut optics.interior, &|part, a, b, phi, k| {
        let shape = 1.0 + 0.3 * (a.cos() + b.cos() - 1.0) + 0.1 * a.sin() * b.sin() * phi.cos();
        let share = match part {
            Part::Adaxial => [0.2, 0.1, 0.05],
            Part::Abaxial => [0.25, 0.1, 0.05],
            Part::Through => [0.02, 0.13, 0.1],
        };
        share[k] / PI * shape
    });
    let share = |value: f64| Estimate { value, standard_error: 0.0 };
    for side in [Side::Adaxial, Side::Abaxial] {
        for i in 0..thetas {
            let incident_deg = surface.theta_deg(i);
            let shares = optics.lamp_shares(side, incident_deg);
            let interior = |out: usize| shares.interior.iter().map(|s| s[out]).sum::<f64>();
            optics.totals.push(WhiteTotals {
                side,
                incident_deg,
                surface: share(shares.surface[0]),
                interior: share(interior(0)),
                transmitted: share(interior(1)),
            });
        }
    }
    optics
}
