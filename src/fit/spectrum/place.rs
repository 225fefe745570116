//! In which layers a petal's pigments are, when only their sum over the petal is known.
//!
//! Model: region r holds the share w_r of a pigment's amount. Where the petal already has some of the pigment, the
//! shares are its own. Else (our reading) anthocyanin and carotenoid are in the epidermes, chlorophyll in the palisade and
//! the spongy layer, each at one concentration: w_r is r's share of these layers' volume. Without an epidermis all are in
//! the slabs. Guarded by `pigments_are_where_the_petal_has_them`.

use crate::micro::tissue::{EpidermisDescription, SlabDescription};
use crate::micro::{REGIONS, Tissue, TissueDescription};
use crate::spectrum::Pigments;
use crate::spectrum::pigment::Pigment;

/// The pigments that are fitted.
pub(crate) const FITTED: [Pigment; 3] = [Pigment::Anthocyanin, Pigment::Carotenoid, Pigment::Chlorophyll];

/// Shares of each fitted pigment in the regions.
pub(crate) fn shares(tissue: &Tissue) -> [[f64; REGIONS]; 3] {
    FITTED.map(|pigment| {
        let depth_um = &tissue.depth_um;
        let own: [f64; REGIONS] =
            std::array::from_fn(|r| tissue.pigments[r].amount_ug_per_cm2(pigment, depth_um[r]));
        let only = |regions: [usize; 2]| {
            let mut volume = [0.0; REGIONS];
            regions.into_iter().for_each(|r| volume[r] = depth_um[r]);
            volume
        };
        let [epidermes, slabs] = [only([0, 3]), only([1, 2])];
        let first = if pigment == Pigment::Chlorophyll { slabs } else { epidermes };
        let weights = [own, first, epidermes, slabs].into_iter().find(|w| w.iter().sum::<f64>() > 0.0);
        let weights = weights.unwrap_or([0.0; REGIONS]);
        let sum: f64 = weights.iter().sum();
        weights.map(|w| if sum > 0.0 { w / sum } else { 0.0 })
    })
}

/// Pigments that are not fitted, in the regions.
pub(crate) fn others(tissue: &Tissue) -> [Pigments; REGIONS] {
    tissue.pigments.clone().map(|p| Pigments {
        flavonol_ug_per_cm2: p.flavonol_ug_per_cm2,
        flavonol_mol_per_l: p.flavonol_mol_per_l,
        brown: p.brown,
        water_um: p.water_um,
        ..Pigments::default()
    })
}

/// The tissue with `amounts` (ug/cm2) of the fitted pigments at their places.
pub(crate) fn put(
    description: &TissueDescription,
    tissue: &Tissue,
    amounts: [f64; 3],
    peak_nm: f64,
) -> TissueDescription {
    let (shares, others) = (shares(tissue), others(tissue));
    let pigments: [Pigments; REGIONS] = std::array::from_fn(|r| {
        let amount = |p: usize| amounts[p] * shares[p][r];
        let here = amount(0) > 0.0;
        Pigments {
            anthocyanin_ug_per_cm2: amount(0),
            anthocyanin_peak_nm: if here { peak_nm } else { Pigments::default().anthocyanin_peak_nm },
            carotenoid_ug_per_cm2: amount(1),
            chlorophyll_ug_per_cm2: amount(2),
            ..others[r].clone()
        }
    });
    let [adaxial, palisade, spongy, abaxial] = pigments;
    let epidermis = |e: &Option<EpidermisDescription>, pigments| {
        e.clone().map(|e| EpidermisDescription { pigments, ..e })
    };
    let slab = |s: &Option<SlabDescription>, pigments| s.clone().map(|s| SlabDescription { pigments, ..s });
    TissueDescription {
        adaxial: epidermis(&description.adaxial, adaxial),
        palisade: slab(&description.palisade, palisade),
        spongy: slab(&description.spongy, spongy),
        abaxial: epidermis(&description.abaxial, abaxial),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::micro::CellDescription;

    fn tissue(text: &str) -> (TissueDescription, Tissue) {
        let d: TissueDescription = toml::from_str(text).expect("parses");
        let tissue = Tissue::new(&d, &CellDescription::default(), "tissue").expect("valid");
        (d, tissue)
    }

    #[test]
    fn pigments_are_where_the_petal_has_them() {
        let spongy = "[spongy]\nthickness_um = 100.0\nscattering_per_mm = 30.0\nanisotropy = 0.5\n";
        let (_, bare) = tissue(spongy);
        assert_eq!(shares(&bare), [[0.0, 0.0, 1.0, 0.0]; 3]);
        let (d, own) = tissue(&format!(
            "{spongy}[spongy.pigments]\nflavonol_mol_per_l = 0.01\n[adaxial]\n[abaxial]\ndepth_um = 10.0\n\
             [adaxial.pigments]\nanthocyanin_mol_per_l = 0.02\nanthocyanin_peak_nm = 520.0\n\
             [abaxial.pigments]\nanthocyanin_mol_per_l = 0.01"
        ));
        let (upper, lower) = (own.depth_um[0], own.depth_um[3]);
        let [anthocyanin, carotenoid, chlorophyll] = shares(&own);
        // Twice as dense above; one concentration of carotenoid.
        assert!((anthocyanin[0] - 2.0 * upper / (2.0 * upper + lower)).abs() < 1e-12);
        assert!((carotenoid[3] - lower / (upper + lower)).abs() < 1e-12);
        assert_eq!(chlorophyll, [0.0, 0.0, 1.0, 0.0]);
        let put = put(&d, &own, [30.0, 0.0, 2.0], 541.0);
        let after = Tissue::new(&put, &CellDescription::default(), "tissue").expect("valid");
        let sum = |p: Pigment| -> f64 {
            (0..REGIONS).map(|r| after.pigments[r].amount_ug_per_cm2(p, after.depth_um[r])).sum()
        };
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        close(sum(Pigment::Anthocyanin), 30.0);
        close(sum(Pigment::Carotenoid), 0.0);
        close(sum(Pigment::Chlorophyll), 2.0);
        assert_eq!(shares(&after)[0].map(|w| (w * 1e9).round()), anthocyanin.map(|w| (w * 1e9).round()));
        assert_eq!(after.pigments[0].anthocyanin_peak_nm, 541.0);
        assert_eq!(after.pigments[2].flavonol_mol_per_l, 0.01);
    }
}
