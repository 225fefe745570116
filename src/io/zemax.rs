//! Zemax/Radiant tabular BSDF (`.bsdf`, text), read only.
//!
//! `Source`, `Symmetry`, `SpectralContent` (Monochrome, XYZ), `ScatterType` (BRDF, BTDF), then a count and the list of
//! angles for each of `SampleRotation`, `AngleOfIncidence`, `ScatterAzimuth`, `ScatterRadial` (degrees), then per band
//! `DataBegin`, per rotation and incidence `TIS x` and one row of radial values per azimuth, `DataEnd`. Values are 1/sr.
//!
//! Angles are about the mirror direction (BTDF: the straight-on direction): radial 0 is that direction, azimuth 0
//! leans from it towards the normal. Directions on the wrong side of the surface are padding of the grid: left out and
//! counted in the notes (`the_grid_is_about_the_mirror_direction`). At radial 0 all azimuths are one direction; the first
//! counts. The sample's rotation is taken as the lamp's azimuth (our reading; no matter for isotropic samples).
//! Source: the format's specification by Radiant Imaging.

use super::conventions::about_pole;
use super::csv_options::text;
use crate::gonio::measurement::direction_deg;
use crate::gonio::{Band, Measurement, Reading, Scale};
use crate::{Error, Result};

/// Words of the file in order, with their lines.
struct Words<'a> {
    words: Vec<(usize, &'a str)>,
    next: usize,
    name: &'a str,
}

impl<'a> Words<'a> {
    fn new(text: &'a str, name: &'a str) -> Self {
        let words = text
            .lines()
            .enumerate()
            .filter(|(_, l)| !l.trim_start().starts_with('#'))
            .flat_map(|(i, l)| l.split_ascii_whitespace().map(move |w| (i + 1, w)))
            .collect();
        Self { words, next: 0, name }
    }

    /// Error at the word that was read last.
    fn wrong(&self, what: impl Into<String>) -> Error {
        let line = self.words.get(self.next.saturating_sub(1)).map_or(1, |w| w.0);
        Error::invalid(format!("{}:{line}", self.name), what)
    }

    fn word(&mut self, what: &str) -> Result<&'a str> {
        let Some((_, word)) = self.words.get(self.next) else {
            return Err(self.wrong(format!("the file ends where {what} should be")));
        };
        self.next += 1;
        Ok(word)
    }

    fn key(&mut self, key: &str) -> Result<()> {
        let word = self.word(key)?;
        if word.eq_ignore_ascii_case(key) {
            Ok(())
        } else {
            Err(self.wrong(format!("`{word}` where {key} should be")))
        }
    }

    /// The word after `key`, as its place in the list of known words.
    fn one_of(&mut self, key: &str, known: &[&str]) -> Result<usize> {
        self.key(key)?;
        let word = self.word(key)?;
        known
            .iter()
            .position(|k| k.eq_ignore_ascii_case(word))
            .ok_or_else(|| self.wrong(format!("{key}: `{word}` is not one of {}", known.join(", "))))
    }

    fn number(&mut self, what: &str) -> Result<f64> {
        let word = self.word(what)?;
        match word.parse::<f64>() {
            Ok(v) if v.is_finite() => Ok(v),
            Ok(_) => Err(self.wrong(format!("{what}: `{word}` is not finite"))),
            Err(_) => Err(self.wrong(format!("{what}: `{word}` is not a number"))),
        }
    }

    /// A count and as many angles.
    fn angles(&mut self, key: &str, range: std::ops::RangeInclusive<f64>) -> Result<Vec<f64>> {
        self.key(key)?;
        let word = self.word(key)?;
        let count: usize =
            word.parse().map_err(|_| self.wrong(format!("{key}: `{word}` is not a number of angles")))?;
        let left = self.words.len() - self.next;
        if count == 0 || count > left {
            return Err(self.wrong(format!("{key}: {count} angles, but {left} words are left")));
        }
        (0..count)
            .map(|_| {
                let deg = self.number(key)?;
                if range.contains(&deg) {
                    Ok(deg)
                } else {
                    Err(self.wrong(format!(
                        "{key}: {deg} is not in {} to {} deg",
                        range.start(),
                        range.end()
                    )))
                }
            })
            .collect()
    }
}

/// Reads a file; `name` (its own) stands in errors as `name:line`.
pub fn read(bytes: &[u8], name: &str) -> Result<Measurement> {
    let text = text(bytes, name)?;
    let mut words = Words::new(text, name);
    words.key("Source")?;
    words.word("Source")?;
    words.one_of("Symmetry", &["PlaneSymmetrical", "Asymmetrical", "Asymmetrical4D"])?;
    let is_xyz = words.one_of("SpectralContent", &["Monochrome", "XYZ"])? == 1;
    let is_btdf = words.one_of("ScatterType", &["BRDF", "BTDF"])? == 1;
    let rotations = words.angles("SampleRotation", -360.0..=360.0)?;
    let incidences = words.angles("AngleOfIncidence", 0.0..=89.999_999)?;
    let azimuths = words.angles("ScatterAzimuth", -360.0..=360.0)?;
    let radials = words.angles("ScatterRadial", 0.0..=180.0)?;

    let mut m = Measurement {
        sample: name.into(),
        series: vec![name.into()],
        bands: if is_xyz {
            ["CIE-X", "CIE-Y", "CIE-Z"].map(Band::named).to_vec()
        } else {
            vec![Band::named("Monochrome")]
        },
        scale: Scale::Absolute,
        ..Default::default()
    };
    let (mut padding, mut tis) = (0, Vec::new());
    for band in 0..m.bands.len() {
        words.key(if is_xyz {
            ["TristimulusX", "TristimulusY", "TristimulusZ"][band]
        } else {
            "Monochrome"
        })?;
        words.key("DataBegin")?;
        for &rotation in &rotations {
            for &incidence in &incidences {
                words.key("TIS")?;
                tis.push(words.number("TIS")?.to_string());
                let wi = direction_deg(incidence, rotation.rem_euclid(360.0));
                for (a, &azimuth) in azimuths.iter().enumerate() {
                    // 360 after 0 is the same again.
                    let again = a > 0 && (azimuth - azimuths[0] - 360.0).abs() < 1e-9;
                    for &radial in &radials {
                        let value = words.number("value")?;
                        if value < 0.0 {
                            return Err(words.wrong(format!("{value} is negative")));
                        }
                        if again || (radial == 0.0 && a > 0) {
                            continue;
                        }
                        let w = about_pole(incidence, direction_deg(radial, azimuth.rem_euclid(360.0)));
                        // A horizon that is only rounding belongs to the measured side.
                        if w.z < -1e-9 {
                            padding += 1;
                            continue;
                        }
                        let (s, c) = rotation.to_radians().sin_cos();
                        let z = if is_btdf { -w.z.max(1e-12) } else { w.z.max(0.0) };
                        m.readings.push(Reading {
                            wi,
                            wo: glam::DVec3::new(w.x * c - w.y * s, w.x * s + w.y * c, z),
                            series: 0,
                            band: band as u32,
                            bsdf_per_sr: value,
                            sigma_per_sr: None,
                        });
                    }
                }
            }
        }
        words.key("DataEnd")?;
    }
    if words.next < words.words.len() {
        words.next += 1;
        return Err(words.wrong("text after the end of the data"));
    }
    if m.readings.is_empty() {
        return Err(words.wrong("no direction of the grid is on the measured side"));
    }
    if padding > 0 {
        m.notes.push(format!("{padding} values behind the surface left out"));
    }
    m.notes.push(format!("total scatter (TIS) in the file: {}", tis.join(" ")));
    Ok(m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::damage::damage;

    fn file(kind: &str, content: &str, lists: [&str; 4], value: impl Fn(usize, usize) -> f64) -> String {
        let count = |l: &str| l.split(' ').count();
        let mut text = format!(
            "#by hand\nSource\tMeasured\nSymmetry  PlaneSymmetrical\nSpectralContent  {content}\nScatterType  {kind}\n"
        );
        for (key, list) in
            ["SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial"].iter().zip(lists)
        {
            text += &format!("{key} {}\n{list}\n", count(list));
        }
        let bands: &[&str] = if content == "XYZ" {
            &["TristimulusX", "TristimulusY", "TristimulusZ"]
        } else {
            &["Monochrome"]
        };
        for band in bands {
            text += &format!("\n{band}\nDataBegin\n");
            for _ in 0..count(lists[0]) * count(lists[1]) {
                text += "TIS 0.25\n";
                for a in 0..count(lists[2]) {
                    let row: Vec<String> =
                        (0..count(lists[3])).map(|r| format!("{:.3E}", value(a, r))).collect();
                    text += &(row.join("\t") + "\n");
                }
            }
            text += "DataEnd\n";
        }
        text
    }

    #[test]
    fn the_grid_is_about_the_mirror_direction() {
        let lists = ["0", "30", "0 90 180", "0 30 60 80"];
        let text = file("BRDF", "Monochrome", lists, |a, r| (1 + 10 * a + r) as f64);
        let m = read(text.as_bytes(), "x.bsdf").unwrap();
        // Four at azimuth 0, three at 90, at 180 two of three: 80 beyond the mirror direction is below the surface.
        let at = |theta: f64, phi: f64| {
            let w = direction_deg(theta, phi);
            m.readings.iter().find(|r| r.wo.distance(w) < 1e-9).map(|r| r.bsdf_per_sr)
        };
        assert_eq!(at(30.0, 180.0), Some(1.0));
        assert_eq!(at(0.0, 0.0), Some(2.0));
        assert_eq!(at(30.0, 0.0), Some(3.0));
        assert_eq!(at(50.0, 0.0), Some(4.0));
        assert_eq!(at(60.0, 180.0), Some(22.0));
        assert_eq!(at(90.0, 180.0), Some(23.0));
        assert_eq!(m.readings.len(), 9);
        assert!(m.readings.iter().all(|r| r.wo.z >= 0.0 && r.wo.is_normalized()));
        assert_eq!(
            m.notes,
            ["1 values behind the surface left out", "total scatter (TIS) in the file: 0.25"]
        );
        // Transmission: the same turned to the other side.
        let through = read(text.replace("BRDF", "BTDF").as_bytes(), "x.bsdf").unwrap();
        for (t, r) in through.readings.iter().zip(&m.readings) {
            assert!(t.wo.distance(glam::DVec3::new(r.wo.x, r.wo.y, -r.wo.z)) < 1e-9 && t.wo.z < 0.0);
        }
        // A turned sample turns lamp and detector.
        let turned =
            file("BRDF", "XYZ", ["0 40", "30", "0 90 180 360", "0 30 60 80"], |a, r| (1 + 10 * a + r) as f64);
        let turned = read(turned.as_bytes(), "x.bsdf").unwrap();
        assert_eq!((turned.bands.len(), turned.readings.len()), (3, 2 * 3 * 9));
        let last = turned.readings.last().unwrap();
        assert!(last.wi.distance(direction_deg(30.0, 40.0)) < 1e-12);
        assert!(last.wo.distance(direction_deg(90.0, 220.0)) < 1e-9);
    }

    #[test]
    fn malformed_files_name_the_line() {
        let text = file("BRDF", "Monochrome", ["0", "30", "0 90", "0 30"], |_, _| 0.5);
        for (from, to, start) in [
            ("Source", "Sauce", "x:2: `Sauce` where Source"),
            ("PlaneSymmetrical", "Round", "x:3: Symmetry: `Round` is not one of"),
            ("BRDF", "BSSRDF", "x:5: ScatterType"),
            ("AngleOfIncidence 1\n30", "AngleOfIncidence 1\n95", "x:9: AngleOfIncidence: 95"),
            ("AngleOfIncidence 1", "AngleOfIncidence 4000000000", "x:8: AngleOfIncidence: 4000000000 angles"),
            ("AngleOfIncidence 1", "AngleOfIncidence many", "x:8: AngleOfIncidence: `many`"),
            ("TIS 0.25", "0.25", "x:17: `0.25` where TIS"),
            ("5.000E-1\t5.000E-1\nDataEnd", "5.000E-1\nDataEnd", "x:20: value: `DataEnd`"),
            ("5.000E-1\t5.000E-1\nDataEnd", "5.000E-1\t-1\nDataEnd", "x:19: -1 is negative"),
            ("5.000E-1\t5.000E-1\nDataEnd", "5.000E-1\tNaN\nDataEnd", "x:19: value: `NaN` is not finite"),
            ("DataEnd", "", "x:19: the file ends where DataEnd"),
            ("DataEnd", "DataEnd\n1 2", "x:21: text after"),
        ] {
            let wrong = text.replacen(from, to, 1);
            assert_ne!(wrong, text);
            let message = read(wrong.as_bytes(), "x").unwrap_err().to_string();
            assert!(message.starts_with(start), "{start}: {message}");
        }
        assert!(read(b"", "x").unwrap_err().to_string().starts_with("x:1: the file ends"));
    }

    #[test]
    fn damaged_files_are_errors() {
        let text = file("BTDF", "XYZ", ["0 90", "10 50", "0 90 180", "0 10 20 60"], |_, _| 0.5);
        damage(text.as_bytes(), 300, |bytes| read(bytes, "x"));
    }
}
