//! Walks through real cells: 'Rote Rose' with its four layers.

use std::sync::Arc;

use super::*;
use crate::gonio::white_counts::Counts;
use crate::micro::{CellDescription, CellWalk, Tissue, TissueDescription};

const TISSUE: &str = "
[adaxial]
depth_um = 20.0
[palisade]
thickness_um = 40.0
scattering_per_mm = 40.0
anisotropy = 0.85
[spongy]
thickness_um = 110.0
scattering_per_mm = 100.0
anisotropy = 0.8
[abaxial]
depth_um = 15.0
roughness = 0.2
";

fn rose() -> CellWalk {
    let description: TissueDescription = toml::from_str(TISSUE).unwrap();
    CellWalk::new(Arc::new(Tissue::new(&description, &CellDescription::default(), "tissue").unwrap()))
}

/// Absorption of anthocyanin at its peak, 0.0725 cm2/ug, for amounts in the upper and the lower epidermis (ug/cm2) and an
/// optical depth of the mesophyll.
fn pigment(walk: &CellWalk, upper: f64, lower: f64, mesophyll: f64) -> [f64; REGIONS] {
    let d = walk.tissue().depth_um;
    let slabs = d[1] + d[2];
    [0.0725 * upper / d[0], mesophyll / slabs, mesophyll / slabs, 0.0725 * lower / d[3]]
}

#[test]
fn cells_keep_white_light() {
    let walk = rose();
    let settings = WhiteMonteCarlo { walks: 30_000, thetas: 6, ..small() };
    let o = settings.measure(&walk, walk.tissue().depth_um, &go).unwrap();
    for t in &o.totals {
        // Each share has its noise, their sum has none: every walk leaves, but for light that grazes for ever.
        let sum = t.surface.value + t.interior.value + t.transmitted.value;
        assert!((sum - 1.0).abs() <= o.cut_off as f64 / 5000.0 + 1e-12, "{t:?}");
        let (r, through) = o.reflectance(t.side, t.incident_deg, &[0.0; REGIONS]);
        assert!(r + through <= 1.0 && r + through > 0.9998, "{r} {through}");
        let noise = 4.0 * t.transmitted.standard_error;
        assert!((through - t.transmitted.value).abs() < 0.01 + noise, "{through} {t:?}");
    }
    assert_eq!(o.cut_off, 0);
}

#[test]
fn cells_are_reciprocal() {
    // Raw counts of the two ways of each pair of bins, summed over classes and azimuths, against one another.
    let walk = rose();
    let settings = WhiteMonteCarlo { walks: 60_000, thetas: 6, ..small() };
    let classes = PathClasses::new(&Default::default(), &walk.tissue().depth_um, 3);
    let bins = |grid, classes| ExitBins { grid, classes };
    let instrument = Instrument {
        surface: bins(settings.surface(), 1),
        interior: bins(settings.interior(), 3),
        classes,
        training: Vec::new(),
        checks: Vec::new(),
    };
    let counts = settings.follow(&walk, &instrument, &go).unwrap();
    let grid = settings.interior();
    let n = 6;
    let (mut chi2, mut pairs) = ([0.0; 2], [0.0; 2]);
    let one_way = |c: &Counts, surface: bool, through: bool, b: usize| -> f64 {
        let (bins, values) =
            if surface { (&instrument.surface, &c.surface) } else { (&instrument.interior, &c.interior) };
        let first = bins.first(through, b, 0);
        values[first..first + bins.grid.phis * bins.classes].iter().map(|v| f64::from(*v)).sum()
    };
    for (from, back, through) in [(0, 0, false), (1, 1, false), (0, 1, true)] {
        for a in 0..n {
            for b in 0..n {
                if !through && b <= a {
                    continue;
                }
                for surface in [false, true] {
                    let there = one_way(&counts[from * n + a], surface, through, b);
                    let reverse = one_way(&counts[back * n + b], surface, through, a);
                    let (pa, pb) = (grid.bin_measure(a), grid.bin_measure(b));
                    if there + reverse < 20.0 {
                        continue;
                    }
                    chi2[usize::from(surface)] +=
                        (pa * there - pb * reverse).powi(2) / (pa * pa * there + pb * pb * reverse);
                    pairs[usize::from(surface)] += 1.0;
                }
            }
        }
    }
    for (chi2, pairs) in chi2.into_iter().zip(pairs) {
        let z = (chi2 - pairs) / (2.0f64 * pairs).sqrt();
        assert!(pairs > 15.0 && z < 4.0, "{chi2} of {pairs}");
    }
}

#[test]
fn cells_recoloured_as_absorbed_on_the_way() {
    let walk = rose();
    let settings = WhiteMonteCarlo { walks: 72_000, thetas: 6, interior_phis: 3, ..small() };
    let o = settings.measure(&walk, walk.tissue().depth_um, &go).unwrap();
    assert!(o.class_error < 0.035, "{}", o.class_error);
    let amounts = [
        (30.0, 0.0, 0.0),
        (120.0, 0.0, 0.0),
        (0.0, 60.0, 0.0),
        (45.0, 20.0, 0.0),
        (60.0, 60.0, 0.0),
        (0.0, 0.0, 0.5),
    ];
    let n = 24_000;
    for (family, side) in [(1, Side::Adaxial), (4, Side::Adaxial), (8, Side::Abaxial)] {
        let incident_deg = settings.surface().theta_deg(family % 6);
        let white = o.reflectance(side, incident_deg, &[0.0; REGIONS]);
        for (k, (upper, lower, mesophyll)) in amounts.into_iter().enumerate() {
            let mu = pigment(&walk, upper, lower, mesophyll);
            // Half of the walks as light that is absorbed on its way, half as white walks with weights.
            let mut ends = [[crate::math::stats::Welford::default(); 2]; 2];
            for i in 0..n {
                let mut stream = Stream::new(99, (k * 100 + family) as u64, i);
                let wi = settings.lamp(family, &mut stream);
                let analog = usize::from(i % 4 == 0);
                let end = if analog == 1 {
                    walk.absorbing(wi, &mu, &mut stream).map(|end| (end, 1.0))
                } else {
                    let end = walk.walk(wi, &mut stream);
                    let weight = if let End::Left(exit) = end { exit.remaining(&mu) } else { 0.0 };
                    Some((end, weight))
                };
                let mut shares = [0.0; 2];
                if let Some((End::Left(exit), weight)) = end {
                    shares[usize::from((exit.direction.z > 0.0) != (wi.z > 0.0))] = weight;
                }
                (0..2).for_each(|way| ends[analog][way].push(shares[way]));
            }
            let (r, t) = o.reflectance(side, incident_deg, &mu);
            for (way, (got, white)) in [(r, white.0), (t, white.1)].into_iter().enumerate() {
                for direct in ends.iter().map(|e| &e[way]) {
                    // The tables' own noise is that of 12 000 walks.
                    let noise = direct.standard_error().hypot(direct.variance().sqrt() / 12_000f64.sqrt());
                    let error = got - direct.mean();
                    assert!(error.abs() < 0.05 * white + 4.0 * noise, "{side:?} {incident_deg}");
                }
            }
        }
    }
}

#[test]
#[ignore = "slow tier: scripts/test runs it"]
fn default_measurement_recolours_within_a_hundredth() {
    // Independent walks, weighted one by one, at every lamp of both sides.
    let walk = rose();
    let settings = WhiteMonteCarlo::default();
    let o = settings.measure(&walk, walk.tissue().depth_um, &go).unwrap();
    assert!(o.class_error < 0.01, "{}", o.class_error);
    let amounts = [(30.0, 0.0), (120.0, 0.0), (0.0, 60.0), (0.0, 120.0), (45.0, 20.0), (60.0, 60.0)];
    let mu = amounts.map(|(upper, lower)| pigment(&walk, upper, lower, 0.0));
    let n = 40_000;
    for family in 0..2 * settings.thetas {
        let side = if family < settings.thetas { Side::Adaxial } else { Side::Abaxial };
        let incident_deg = settings.surface().theta_deg(family % settings.thetas);
        let mut direct = [[crate::math::stats::Welford::default(); 2]; 6];
        for i in 0..n {
            let mut stream = Stream::new(77, family as u64, i);
            let wi = settings.lamp(family, &mut stream);
            let End::Left(exit) = walk.walk(wi, &mut stream) else { continue };
            let way = usize::from((exit.direction.z > 0.0) != (wi.z > 0.0));
            for (direct, mu) in direct.iter_mut().zip(&mu) {
                direct[way].push(exit.remaining(mu));
                direct[1 - way].push(0.0);
            }
        }
        for (direct, mu) in direct.iter().zip(&mu) {
            let (r, t) = o.reflectance(side, incident_deg, mu);
            for (got, direct) in [r, t].into_iter().zip(direct) {
                // 0.01 of the light; beyond it only the noise of the direct walks.
                let error = (got - direct.mean()).abs();
                let limit = 0.01 + 3.0 * direct.standard_error();
                assert!(error < limit, "{side:?} {incident_deg} {mu:?}: {got} {}", direct.mean());
            }
        }
    }
}
