use std::collections::BTreeMap;

use super::*;
use crate::geometry::Mesh;
use crate::geometry::crossings::crossings;

fn arrangement(kind: ArrangementKind, seed: u64) -> ArrangementDescription {
    ArrangementDescription {
        kind,
        seed,
        openness: [0.3, 0.95],
        opening_height_mm: 170.0,
        opening_radius_mm: 26.0,
        ..Default::default()
    }
}

fn low_detail() -> RoseDescription {
    RoseDescription { petals: 16, detail: 0.3, ..RoseDescription::hybrid_tea() }
}

/// Quick to grow: where roses stand depends on their size alone.
fn few_petals() -> RoseDescription {
    RoseDescription { petals: 5, ..low_detail() }
}

/// Crossing pairs of triangles of different roses, by the kinds of their organs.
fn met(flowers: &[Flower]) -> BTreeMap<[String; 2], usize> {
    let organs: Vec<(usize, OrganKind, &Mesh)> = flowers
        .iter()
        .enumerate()
        .flat_map(|(k, f)| f.organs.iter().map(move |o| (k, o.kind, &o.mesh)))
        .collect();
    let meshes: Vec<&Mesh> = organs.iter().map(|o| o.2).collect();
    let mut met = BTreeMap::new();
    for c in crossings(&meshes) {
        let [a, b] = c.meshes.map(|m| &organs[m as usize]);
        if a.0 != b.0 {
            let mut kinds = [format!("{:?}", a.1), format!("{:?}", b.1)];
            kinds.sort();
            *met.entry(kinds).or_insert(0) += 1;
        }
    }
    met
}

#[test]
fn petals_of_neighbours_do_not_meet() {
    for kind in [ArrangementKind::Vase, ArrangementKind::Bush] {
        for seed in 0..3 {
            let count = Some(if kind == ArrangementKind::Bush { 5 } else { 3 });
            let a = ArrangementDescription { count, ..arrangement(kind, seed) };
            let placed = a.place(&low_detail()).expect("places");
            let mut flowers: Vec<Flower> = placed.iter().map(|p| p.grow().expect("grows")).collect();
            let leaves = |flowers: &[Flower]| -> usize {
                flowers.iter().map(|f| f.of_kind(OrganKind::Leaf).count()).sum()
            };
            let grown = leaves(&flowers);
            clearing::clear(&mut flowers);
            assert_eq!(flowers.len(), a.count() as usize);
            let met = met(&flowers);
            for ([one, other], pairs) in &met {
                for organ in ["Petal", "Sepal", "Leaf", "Receptacle"] {
                    assert!(one != organ && other != organ, "{kind:?} {seed}: {one} x {other}: {pairs}");
                }
            }
            // Most leaves stay.
            assert!(3 * leaves(&flowers) > 2 * grown, "{kind:?} {seed}: {} of {grown}", leaves(&flowers));
        }
    }
}

#[test]
fn stems_pass_the_opening() {
    for seed in 0..8 {
        let a = arrangement(ArrangementKind::Vase, seed);
        let placed = a.place(&few_petals()).expect("places");
        for p in &placed {
            let stem = p.rose.stem.axis(&[]);
            for k in 0..=100 {
                let at = p.rotation * stem.centre_mm(0.01 * f64::from(k) * stem.length_mm()) + p.position_mm;
                let inside = at.truncate().length() + stem.radius_mm(0.0) < a.opening_radius_mm;
                assert!(inside || at.z > a.opening_height_mm, "{at}");
                assert!(at.z > 0.0);
            }
            // Leaves stand above the opening.
            for node in p.rose.leaves.nodes_mm(p.rose.stem.length_mm) {
                let z = (p.rotation * stem.centre_mm(node) + p.position_mm).z;
                assert!(z > a.opening_height_mm, "{z}");
            }
        }
    }
}

#[test]
fn every_rose_is_its_own() {
    for kind in [ArrangementKind::Vase, ArrangementKind::Bush] {
        let a = arrangement(kind, 5);
        let placed = a.place(&few_petals()).expect("places");
        assert_eq!(placed, a.place(&few_petals()).expect("places"));
        let openness: Vec<f64> = placed.iter().map(|p| p.rose.openness).collect();
        assert!((openness[0] - 0.95).abs() < 1e-12 && (openness[placed.len() - 1] - 0.3).abs() < 1e-12);
        for (k, p) in placed.iter().enumerate() {
            // Stems start at the ground and arch outwards: flowers lean more than their chords.
            let foot = p.rotation * p.rose.stem.axis(&[]).centre_mm(p.rose.stem.length_mm) + p.position_mm;
            assert!(foot.truncate().length() < 50.0 && foot.z.abs() < 20.0, "{foot}");
            let axis = p.rotation * DVec3::Z;
            assert!(axis.z <= (p.position_mm - foot).normalize().z + 1e-9);
            for q in &placed[..k] {
                assert_ne!(p.rose.seed, q.rose.seed);
                assert!(p.position_mm.distance(q.position_mm) > 40.0);
            }
        }
    }
}

#[test]
fn impossible_arrangements_are_refused() {
    let base = arrangement(ArrangementKind::Vase, 0);
    let says = |a: ArrangementDescription, what: &str| {
        let e = a.place(&few_petals()).expect_err("refused").to_string();
        assert!(e.contains(what), "{e}");
    };
    says(ArrangementDescription { count: Some(0), ..base.clone() }, "arrangement.count");
    says(ArrangementDescription { count: Some(65), ..base.clone() }, "arrangement.count");
    says(ArrangementDescription { openness: [f64::NAN, 1.0], ..base.clone() }, "arrangement.openness");
    says(ArrangementDescription { height_mm: Some(f64::INFINITY), ..base.clone() }, "arrangement.height_mm");
    says(ArrangementDescription { spread_deg: Some(-1.0), ..base.clone() }, "arrangement.spread_deg");
    says(
        ArrangementDescription { opening_radius_mm: f64::NAN, ..base.clone() },
        "arrangement.opening_radius_mm",
    );
    says(ArrangementDescription { opening_radius_mm: 6.0, ..base }, "find no place");
}
