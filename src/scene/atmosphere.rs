//! The sun's light after its way through the air.
//!
//! Model: the light above the atmosphere times the transmittances of what it meets on m times the vertical way:
//!
//! ```text
//! E(lambda) = E0 T_r T_a T_o T_g T_w          l = lambda in um
//! air, Rayleigh     T_r = exp(-0.008735 l^-4.08 m)
//! aerosol, Angstrom T_a = exp(-beta l^-1.3 m),   beta = 0.04608 T - 0.04586
//! ozone             T_o = exp(-0.35 k_o m)
//! mixed gases       T_g = exp(-1.41 k_g m / (1 + 118.93 k_g m)^0.45)
//! water vapour      T_w = exp(-0.2385 k_w 2 m / (1 + 20.07 k_w 2 m)^0.45)
//! m = 1 / (cos z + 0.15 (93.885 - z)^-1.253)     z: the sun's angle from the zenith, degrees
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | E | result of `sun_irradiance` | W m-2 nm-1, across the light | |
//! | T | `turbidity` | 1 | 3, a clear day |
//! | 90 - z | `elevation_deg` | degrees | |
//! | E0, k_o, k_g, k_w | columns of `data/sun_spctrl2.csv` | W m-2 nm-1, 1/cm, 1/km, 1/cm | |
//!
//! Limits: the mean distance of the sun (3 % more or less in January and July), ozone of 0.35 cm and water of 2 cm, sea level.
//! Guarded by `agrees_with_spctrl2`, `more_air_is_less_and_redder_light`.
//! Source: A. Preetham, P. Shirley, B. Smits, A practical analytic model for daylight, SIGGRAPH 1999, appendix 1, after M. Iqbal
//! 1983; tables of Bird and Riordan 1984.

use crate::spectrum::{Spectrum, Table, table};

/// Ångström's exponent.
const ALPHA: f64 = 1.3;
/// Ozone, cm at standard pressure.
const OZONE_CM: f64 = 0.35;
/// Precipitable water, cm.
const WATER_CM: f64 = 2.0;

/// Spectral irradiance of the sun's disc on a surface that faces it, W m-2 nm-1.
pub(super) fn sun_irradiance(elevation_deg: f64, turbidity: f64) -> Spectrum {
    let table = tables();
    let column = |name: &str| table.spectrum(Some(name)).expect("a column of the built-in table");
    let [e0, water, ozone, mixed] = ["irradiance", "water", "ozone", "mixed"].map(column);
    let at = |column: &Spectrum, nm: f64| f64::from(column.at(nm as f32));
    let z = 90.0 - elevation_deg;
    let m = 1.0 / (z.to_radians().cos() + 0.15 * (93.885 - z).powf(-1.253));
    let beta = 0.046_08 * turbidity - 0.045_86;
    Spectrum::from_fn(|nm| {
        let l = nm / 1000.0;
        let (k_g, k_w) = (at(&mixed, nm) * m, at(&water, nm) * WATER_CM * m);
        let depth = 0.008_735 * l.powf(-4.08) * m
            + beta * l.powf(-ALPHA) * m
            + at(&ozone, nm) * OZONE_CM * m
            + 1.41 * k_g / (1.0 + 118.93 * k_g).powf(0.45)
            + 0.2385 * k_w / (1.0 + 20.07 * k_w).powf(0.45);
        at(&e0, nm) * (-depth).exp()
    })
}

fn tables() -> Table {
    table::parse(include_str!("../../data/sun_spctrl2.csv"), "sun_spctrl2.csv")
        .expect("built-in table, read by every test of the sun")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::Observer;
    use crate::spectrum::band::lux_of_one;

    #[test]
    fn agrees_with_spctrl2() {
        // Direct normal irradiance by pvlib's SPCTRL2 with our ozone, water and turbidity 3 (optical depth of the aerosol at
        // 500 nm 0.2275), its factor for the sun's distance taken out. Its formula of Rayleigh scattering is another.
        for (elevation, expected) in [
            (60.0, [0.8291, 1.1450, 1.2271, 1.2945, 1.2301, 1.1681, 1.0548, 0.9527, 0.6947]),
            (15.0, [0.1586, 0.3155, 0.4444, 0.5424, 0.5504, 0.6351, 0.5821, 0.5127, 0.3191]),
        ] {
            let e = sun_irradiance(elevation, 3.0);
            for (nm, e_nm) in
                [410.0, 450.0, 500.0, 550.0, 593.0, 656.0, 690.0, 724.4, 762.5].into_iter().zip(expected)
            {
                let ours = f64::from(e.at(nm));
                assert!((ours / e_nm - 1.0f64).abs() < 0.045, "{elevation} deg, {nm} nm: {ours} {e_nm}");
            }
        }
    }

    #[test]
    fn more_air_is_less_and_redder_light() {
        let mut last = (f64::INFINITY, f64::INFINITY);
        for (elevation, turbidity) in
            [(90.0, 2.0), (60.0, 2.0), (60.0, 4.0), (20.0, 4.0), (5.0, 4.0), (1.0, 6.0)]
        {
            let e = sun_irradiance(elevation, turbidity);
            let [_, y, z] = Observer::Cie1931.xyz_of(&e);
            assert!(e.min() >= 0.0 && y < last.0 && z / y < last.1, "{elevation} deg, turbidity {turbidity}");
            last = (y, z / y);
        }
        // A clear noon: 100 klx, as handbooks have it.
        let noon = Observer::Cie1931.xyz_of(&sun_irradiance(60.0, 2.0))[1] * lux_of_one();
        assert!((95e3..110e3).contains(&noon), "{noon} lx");
    }
}
