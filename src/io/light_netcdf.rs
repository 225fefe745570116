//! The light of organs, petals or triangles, and of sensors, as NetCDF ([`super::netcdf`]).
//!
//! Dimensions `group`, `side` (adaxial, abaxial) and `band`, and `sensor` where there are sensors. The variables are named
//! as the columns of the CSV ([`super::light_table`]); those of the light have all three dimensions.

use super::light_table::{Flux, LightTable, SIDES};
use super::netcdf::{self, Dataset, Values};
use super::sensors_csv::Reading;
use crate::Result;

/// Name, unit or description, and value.
type Column<T, V> = (&'static str, &'static str, fn(&T) -> V);

/// Writes a table, and readings of sensors in its bands if there are any.
pub fn write(table: &LightTable, readings: &[Reading]) -> Result<Vec<u8>> {
    table.check()?;
    let attributes =
        vec![("Conventions".into(), "CF-1.8".into()), ("history".into(), table.about.join("\n"))];
    let mut d = Dataset { attributes, ..Dataset::default() };
    let group = d.dimension("group", table.groups.len());
    let side = d.dimension("side", 2);
    let band = d.dimension("band", table.bands.len());
    d.texts("side", side, "side that the light arrives on", SIDES.into_iter());
    let ends =
        |of: &dyn Fn(&crate::spectrum::Band) -> f64| Values::Double(table.bands.iter().map(of).collect());
    d.variable("band_low_nm", &[band], ("nm", "lower end of the band"), ends(&|b| b.low_nm));
    d.variable("band_high_nm", &[band], ("nm", "upper end of the band"), ends(&|b| b.high_nm));
    let groups = || table.groups.iter();
    d.texts("shape", group, "key in the scene", groups().map(|g| &*g.shape));
    d.texts("organ", group, "kind of organ", groups().map(|g| g.organ));
    let count = |n: u32| i32::try_from(n).unwrap_or(i32::MAX);
    let ints = |of: &dyn Fn(&super::light_table::Group) -> u32| {
        Values::Int(groups().map(|g| count(of(g))).collect())
    };
    d.variable("organ_id", &[group], ("", "organ, from 1; 0 is none"), ints(&|g| g.organ_id));
    d.variable("petal_id", &[group], ("", "petal, from 1; 0 is none"), ints(&|g| g.petal_id));
    if let Some(name) = table.index_name {
        d.variable(name, &[group], ("", "number"), ints(&|g| g.index));
    }
    let floats = |of: &dyn Fn(&super::light_table::Group) -> f64| {
        Values::Float(groups().map(|g| of(g) as f32).collect())
    };
    d.variable("area_mm2", &[group], ("mm2", "area of one side"), floats(&|g| g.area_mm2));
    for (k, axis) in ["x_mm", "y_mm", "z_mm"].into_iter().enumerate() {
        d.variable(axis, &[group], ("mm", "centre"), floats(&|g| g.centre_mm[k]));
    }
    let all = [group, side, band];
    let light = |of: &dyn Fn(&Flux) -> f64| Values::Float(table.light.iter().map(|f| of(f) as f32).collect());
    for (u, (suffix, unit)) in [("w_m2", "W m-2"), ("umol_m2_s", "umol m-2 s-1")].into_iter().enumerate() {
        let of: [Column<Flux, [f64; 2]>; 3] = [
            ("incident", "light that arrives on the side", |f| f.incident),
            ("absorbed", "what of it is absorbed", |f| f.absorbed),
            ("transmitted", "what of it leaves from the other side", |f| f.transmitted),
        ];
        for (name, about, value) in of {
            d.variable(&format!("{name}_{suffix}"), &all, (unit, about), light(&|f| value(f)[u]));
        }
    }
    let per_group = 2 * table.bands.len();
    let watts = table
        .light
        .iter()
        .enumerate()
        .map(|(i, f)| (f.absorbed[0] * table.groups[i / per_group].area_mm2 * 1e-6) as f32);
    d.variable("absorbed_w", &all, ("W", "absorbed power"), Values::Float(watts.collect()));
    if !readings.is_empty() {
        sensors(&mut d, band, readings);
    }
    netcdf::write(&d)
}

fn sensors(d: &mut Dataset, band: usize, readings: &[Reading]) {
    let sensor = d.dimension("sensor", readings.len());
    d.texts("sensor_name", sensor, "name of the sensor", readings.iter().map(|r| r.sensor.name.as_str()));
    let columns: [Column<Reading, f64>; 6] = [
        ("sensor_x_mm", "mm", |r| r.sensor.position_mm.x),
        ("sensor_y_mm", "mm", |r| r.sensor.position_mm.y),
        ("sensor_z_mm", "mm", |r| r.sensor.position_mm.z),
        ("sensor_nx", "1", |r| r.sensor.normal.x),
        ("sensor_ny", "1", |r| r.sensor.normal.y),
        ("sensor_nz", "1", |r| r.sensor.normal.z),
    ];
    for (name, unit, of) in columns {
        d.variable(name, &[sensor], (unit, ""), Values::Double(readings.iter().map(of).collect()));
    }
    for (u, (suffix, unit)) in [("w_m2", "W m-2"), ("umol_m2_s", "umol m-2 s-1")].into_iter().enumerate() {
        let all = |of: &dyn Fn(&super::sensors_csv::BandReading) -> f64| {
            Values::Float(readings.iter().flat_map(|r| r.bands.iter()).map(|b| of(b) as f32).collect())
        };
        d.variable(
            &format!("sensor_{suffix}"),
            &[sensor, band],
            (unit, "irradiance"),
            all(&|b| b.irradiance[u]),
        );
        let about = "standard error of the irradiance";
        let name = format!("sensor_{suffix}_se");
        d.variable(&name, &[sensor, band], (unit, about), all(&|b| b.standard_error[u]));
    }
}

#[cfg(test)]
mod tests {
    use super::super::light_table::example;
    use super::super::sensors_csv::tests::readings;
    use super::*;

    #[test]
    fn tables_and_sensors_are_written() {
        let table = example();
        let alone = write(&table, &[]).unwrap();
        let both = write(&table, &readings(table.bands.len())).unwrap();
        let has = |bytes: &[u8], name: &str| bytes.windows(name.len()).any(|w| w == name.as_bytes());
        for name in ["incident_w_m2", "absorbed_umol_m2_s", "triangle", "shapes.rose", "absorbed_w"] {
            assert!(has(&alone, name), "{name}");
        }
        assert!(has(&both, "sensor_w_m2_se") && !has(&alone, "sensor"));
        assert!(both.len() > alone.len());
        assert!(write(&LightTable::default(), &[]).is_err());
    }
}
