//! Radiance and WINDOW BSDF XML: writing, from any BSDF.
//!
//! Every known part is written as averages whose hemispherical totals are the source's (see the parts' types in
//! [`super::window_xml`]); where one direction of transmission is known, both are written, by reciprocity, because Radiance's
//! reader fails on one alone. What cannot be said is in [`Written::losses`].
//!
//! `Visible` is CIE-Y under D65: Y = sum over bands of w f, w = integral of D65 times y over the band's share of a linear
//! interpolation between the bands' wavelengths, held beyond the ends; of bands named R, G and B, the luminance of linear sRGB;
//! of a band named CIE-Y, that band. Bands with a wavelength follow as `<Wavelength unit="Nanometer">`, which Radiance skips.
//! Guarded by `visible_is_cie_y_under_d65`, `round_trips`, `a_lobe_lands_where_it_belongs`.

use std::fmt::Write as _;

use glam::DVec3;

use super::klems::{AngleBasis, Klems};
use super::patch_average::{self, Averaged};
use super::tensor_tree::TensorTree;
use super::window_xml::Part;
use super::xml::escape;
use crate::gonio::{Band, Coverage, Directional};
use crate::spectrum::{Illuminant, Observer, VISIBLE_NM};
use crate::{Error, Result};

/// How the numbers are arranged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// Patches of fixed size.
    Klems(Klems),
    /// Boxes that are joined where they agree.
    TensorTree {
        /// 3 for isotropic sources (others are averaged over the azimuth), 4 for any.
        rank: usize,
        /// Boxes per axis are 2 to this: 1 to 7 for rank 3, 1 to 5 for rank 4.
        log2_resolution: u32,
        /// Boxes are joined into their mean where all of them are within this share of it.
        tolerance: f64,
    },
}

impl Default for Form {
    fn default() -> Self {
        Form::Klems(Klems::Full)
    }
}

/// What WINDOW wants to know of a material; nothing is made up for what is absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Material {
    /// Name of the sample.
    pub name: String,
    /// Who made it.
    pub manufacturer: Option<String>,
    /// Thickness, mm.
    pub thickness_mm: Option<f64>,
    /// Width, mm.
    pub width_mm: Option<f64>,
    /// Height, mm.
    pub height_mm: Option<f64>,
}

/// A document and what it does not say.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The file.
    pub text: String,
    /// What was lost, in sentences for the user.
    pub losses: Vec<String>,
}

/// Blocks of numbers, one per channel.
type Texts = Vec<String>;

/// Writes a document.
pub fn write(source: &dyn Directional, form: Form, material: &Material) -> Result<Written> {
    let mut losses = Vec::new();
    check(source, form)?;
    let source = Channels::new(source, &mut losses)?;
    let mut parts: Vec<(Part, Texts)> = Vec::new();
    for part in Part::ALL {
        if !source.covers(part) {
            losses.push(format!("{} is not known and was left out", part.xml_name()));
            continue;
        }
        if !source.known(part) {
            losses.push(format!("{} was written as the reverse of the known direction", part.xml_name()));
        }
        let texts = match form {
            Form::Klems(klems) => {
                let basis = klems.basis();
                let averaged = patch_average::klems(&source, part, &basis);
                note(part, &averaged, &mut losses);
                averaged.bands.iter().map(|values| matrix_text(values, basis.len())).collect()
            }
            Form::TensorTree { rank, log2_resolution, tolerance } => {
                let averaged = patch_average::tree(&source, part, (rank, log2_resolution), tolerance);
                note(part, &averaged, &mut losses);
                averaged.bands.iter().map(TensorTree::text).collect()
            }
        };
        parts.push((part, texts));
    }
    match form {
        Form::TensorTree { rank: 3, .. } if !source.is_isotropic() => {
            losses.push("an anisotropic BSDF was averaged over the azimuth".into());
        }
        _ => {}
    }
    if material.thickness_mm.is_none() {
        losses.push("WINDOW wants a thickness; none is known".into());
    }
    Ok(Written { text: document(form, material, &source.channels, &parts), losses })
}

fn check(source: &dyn Directional, form: Form) -> Result<()> {
    if source.bands().is_empty() || source.coverage() == Coverage::default() {
        return Err(Error::invalid("BSDF XML", "there is no band or no part to write"));
    }
    if let Form::TensorTree { rank, log2_resolution, tolerance } = form {
        let most = match rank {
            3 => 7,
            4 => 5,
            _ => return Err(Error::invalid("rank", format!("{rank}: expected 3 or 4"))),
        };
        if !(1..=most).contains(&log2_resolution) {
            let what = format!("{log2_resolution}: expected 1 to {most} for rank {rank}");
            return Err(Error::invalid("log2_resolution", what));
        }
        if !(0.0..1.0).contains(&tolerance) {
            return Err(Error::invalid("tolerance", format!("{tolerance}: expected 0 to 1")));
        }
    }
    Ok(())
}

fn note<T>(part: Part, averaged: &Averaged<T>, losses: &mut Vec<String>) {
    if averaged.unknown > 0.0 {
        let percent = 100.0 * averaged.unknown;
        losses.push(format!(
            "{}: {percent:.2} % of its directions are not known and were taken as 0",
            part.xml_name()
        ));
    }
    if averaged.largest_total > 1.0 + 1e-6 {
        losses.push(format!(
            "{}: sends out {:.4} of the light, more than arrives",
            part.xml_name(),
            averaged.largest_total
        ));
    }
}

/// What is written of one wavelength or integral.
struct Channel {
    /// Element `Wavelength` with its spectra.
    xml: String,
    /// Weight of each of the source's bands.
    weights: Vec<f64>,
}

/// The source with channels for bands, and with both directions of transmission.
struct Channels<'a> {
    source: &'a dyn Directional,
    bands: Vec<Band>,
    channels: Vec<Channel>,
}

impl<'a> Channels<'a> {
    fn new(source: &'a dyn Directional, losses: &mut Vec<String>) -> Result<Self> {
        let bands = source.bands();
        let mut channels = vec![Channel { xml: visible_xml(), weights: visible_weights(bands, losses)? }];
        for (i, band) in bands.iter().enumerate() {
            let mut weights = vec![0.0; bands.len()];
            weights[i] = 1.0;
            let integral = ["Solar", "NIR", "CIE-X", "CIE-Z"];
            let xml = match band.wavelength_nm {
                Some(nm) => format!("<Wavelength unit=\"Nanometer\">{nm}</Wavelength>"),
                None if integral.contains(&band.name.as_str()) => {
                    format!("<Wavelength unit=\"Integral\">{}</Wavelength>", band.name)
                }
                None if is_visible(band) || ["R", "G", "B"].contains(&band.name.as_str()) => continue,
                None => {
                    losses
                        .push(format!("band {} has no name or wavelength that the format knows", band.name));
                    continue;
                }
            };
            channels.push(Channel { xml, weights });
        }
        let bands = channels.iter().map(|c| Band::named(c.xml.clone())).collect();
        Ok(Self { source, bands, channels })
    }

    /// Is the part known as it is?
    fn known(&self, part: Part) -> bool {
        let c = self.source.coverage();
        match part {
            Part::ReflectionAdaxial => c.reflection_adaxial,
            Part::ReflectionAbaxial => c.reflection_abaxial,
            Part::TransmissionAdaxial => c.transmission_adaxial,
            Part::TransmissionAbaxial => c.transmission_abaxial,
        }
    }

    /// Is it known, or its reverse?
    fn covers(&self, part: Part) -> bool {
        self.known(part) || self.known(part.reversed())
    }
}

impl Directional for Channels<'_> {
    fn bands(&self) -> &[Band] {
        &self.bands
    }

    fn coverage(&self) -> Coverage {
        let through = self.covers(Part::TransmissionAdaxial);
        Coverage { transmission_adaxial: through, transmission_abaxial: through, ..self.source.coverage() }
    }

    fn is_isotropic(&self) -> bool {
        self.source.is_isotropic()
    }

    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        // Few enough for the stack in most files.
        let mut few = [0.0; 16];
        let mut many = Vec::new();
        let count = self.source.bands().len();
        let own = if count <= few.len() {
            &mut few[..count]
        } else {
            many.resize(count, 0.0);
            &mut many[..]
        };
        let known = if self.known(Part::of(wi, wo)) {
            self.source.bsdf(wi, wo, own)
        } else {
            self.source.bsdf(wo, wi, own)
        };
        for (value, channel) in values.iter_mut().zip(&self.channels) {
            *value = channel.weights.iter().zip(&*own).map(|(w, v)| w * v).sum();
        }
        known
    }
}

fn is_visible(band: &Band) -> bool {
    ["CIE-Y", "Visible", "Y"].iter().any(|name| band.name.eq_ignore_ascii_case(name))
}

/// Weights of the bands in CIE-Y under D65.
fn visible_weights(bands: &[Band], losses: &mut Vec<String>) -> Result<Vec<f64>> {
    let mut weights = vec![0.0; bands.len()];
    let named =
        |names: &[&str]| bands.iter().position(|b| names.iter().any(|n| b.name.eq_ignore_ascii_case(n)));
    if let Some(y) = bands.iter().position(is_visible) {
        weights[y] = 1.0;
        return Ok(weights);
    }
    let (low, high) = (f64::from(VISIBLE_NM.0), f64::from(VISIBLE_NM.1));
    let mut spectral: Vec<(f64, usize)> =
        bands.iter().enumerate().filter_map(|(i, b)| Some((b.wavelength_nm?, i))).collect();
    spectral.retain(|(nm, _)| (low..=high).contains(nm));
    spectral.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let [(first, _), .., (last, _)] = spectral[..] {
        if first > 450.0 || last < 650.0 {
            losses.push(format!("Visible was computed from bands of {first} to {last} nm only"));
        }
        let d65 = Illuminant::D65.spectrum()?;
        for step in 0..=(high - low) as usize {
            let nm = low + step as f64;
            let y = f64::from(d65.at(nm as f32)) * Observer::Cie1931.cmf(nm as f32)[1];
            let k = spectral.partition_point(|s| s.0 <= nm);
            if k == 0 || k == spectral.len() {
                weights[spectral[k.saturating_sub(usize::from(k > 0))].1] += y;
            } else {
                let ((x0, i0), (x1, i1)) = (spectral[k - 1], spectral[k]);
                let t = (nm - x0) / (x1 - x0);
                weights[i0] += (1.0 - t) * y;
                weights[i1] += t * y;
            }
        }
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
    } else if let [(nm, only)] = spectral[..] {
        losses.push(format!("Visible is the band of {nm} nm: no other is known"));
        weights[only] = 1.0;
    } else if let (Some(r), Some(g), Some(b)) = (named(&["R"]), named(&["G"]), named(&["B"])) {
        losses.push("Visible is the luminance of R, G and B as linear sRGB".into());
        (weights[r], weights[g], weights[b]) = (0.2126, 0.7152, 0.0722);
    } else {
        let names: Vec<&str> = bands.iter().map(|b| b.name.as_str()).collect();
        losses.push(format!("Visible is the mean of the bands {}", names.join(", ")));
        weights.fill(1.0 / bands.len() as f64);
    }
    Ok(weights)
}

fn visible_xml() -> String {
    "<Wavelength unit=\"Integral\">Visible</Wavelength>\n\
     \t\t<SourceSpectrum>CIE Illuminant D65 1nm.ssp</SourceSpectrum>\n\
     \t\t<DetectorSpectrum>ASTM E308 1931 Y.dsp</DetectorSpectrum>"
        .into()
}

fn matrix_text(values: &[f32], n: usize) -> String {
    let mut out = String::new();
    for row in values.chunks(n) {
        for v in row {
            // Writing to a String cannot fail.
            let _ = write!(out, "{v:.6e}, ");
        }
        out.push('\n');
    }
    out
}

fn basis_xml(basis: &AngleBasis) -> String {
    let mut out =
        format!("\t\t<AngleBasis>\n\t\t\t<AngleBasisName>{}</AngleBasisName>\n", escape(&basis.name));
    let mut low = 0.0;
    for (&high, &n) in basis.theta_max_deg.iter().zip(&basis.n_phi) {
        let middle = if low == 0.0 && n == 1 { 0.0 } else { 0.5 * (low + high) };
        let _ = write!(
            out,
            "\t\t\t<AngleBasisBlock>\n\t\t\t\t<Theta>{middle}</Theta>\n\t\t\t\t<nPhis>{n}</nPhis>\n\t\t\t\t<ThetaBounds>\n\
             \t\t\t\t\t<LowerTheta>{low}</LowerTheta>\n\t\t\t\t\t<UpperTheta>{high}</UpperTheta>\n\
             \t\t\t\t</ThetaBounds>\n\t\t\t</AngleBasisBlock>\n"
        );
        low = high;
    }
    out + "\t\t</AngleBasis>\n"
}

fn document(form: Form, material: &Material, channels: &[Channel], parts: &[(Part, Texts)]) -> String {
    let mut out = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <WindowElement xmlns=\"http://windows.lbl.gov\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
         xsi:schemaLocation=\"http://windows.lbl.gov/BSDF-v1.4.xsd\">\n\
         <!-- Rosarium. Back is the adaxial side (Radiance's front, +z), Front the abaxial side. -->\n\
         <WindowElementType>System</WindowElementType>\n<FileType>BSDF</FileType>\n<Optical>\n<Layer>\n\t<Material>\n",
    );
    let manufacturer = material.manufacturer.as_deref().unwrap_or("not stated");
    let name = if material.name.trim().is_empty() { "sample" } else { material.name.trim() };
    let _ = write!(
        out,
        "\t\t<Name>{}</Name>\n\t\t<Manufacturer>{}</Manufacturer>\n",
        escape(name),
        escape(manufacturer)
    );
    let sizes =
        [("Thickness", material.thickness_mm), ("Width", material.width_mm), ("Height", material.height_mm)];
    for (key, mm) in sizes.into_iter().filter_map(|(key, mm)| Some((key, mm?))) {
        let _ = writeln!(out, "\t\t<{key} unit=\"millimeter\">{mm}</{key}>");
    }
    out += "\t\t<DeviceType>Other</DeviceType>\n\t</Material>\n\t<DataDefinition>\n";
    let (structure, basis) = match form {
        Form::Klems(klems) => ("Columns", Some(klems.basis())),
        Form::TensorTree { rank: 3, .. } => ("TensorTree3", None),
        Form::TensorTree { .. } => ("TensorTree4", None),
    };
    let _ = writeln!(out, "\t\t<IncidentDataStructure>{structure}</IncidentDataStructure>");
    out += &basis.as_ref().map_or(String::new(), basis_xml);
    out += "\t</DataDefinition>\n";
    let angle_basis = basis.map_or("\t\t\t<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>\n".to_string(), |b| {
        let b = escape(&b.name);
        format!("\t\t\t<ColumnAngleBasis>{b}</ColumnAngleBasis>\n\t\t\t<RowAngleBasis>{b}</RowAngleBasis>\n")
    });
    for (k, channel) in channels.iter().enumerate() {
        let _ =
            write!(out, "\t<WavelengthData>\n\t\t<LayerNumber>System</LayerNumber>\n\t\t{}\n", channel.xml);
        for (part, texts) in parts {
            let kind = match part {
                Part::ReflectionAdaxial | Part::ReflectionAbaxial => "BRDF",
                Part::TransmissionAdaxial | Part::TransmissionAbaxial => "BTDF",
            };
            let _ = write!(
                out,
                "\t\t<WavelengthDataBlock>\n\t\t\t<WavelengthDataDirection>{}</WavelengthDataDirection>\n{angle_basis}\
                 \t\t\t<ScatteringDataType>{kind}</ScatteringDataType>\n\t\t\t<ScatteringData>\n{}\n\t\t\t</ScatteringData>\n\
                 \t\t</WavelengthDataBlock>\n",
                part.xml_name(),
                texts[k]
            );
        }
        out += "\t</WavelengthData>\n";
    }
    out + "</Layer>\n</Optical>\n</WindowElement>\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Side;
    use crate::gonio::directional::tests::Sheet;
    use crate::gonio::directional_hemispherical;
    use crate::gonio::measurement::direction_deg;
    use crate::io::window_xml::read;

    fn material() -> Material {
        Material { name: "a <petal> & more".into(), thickness_mm: Some(0.2), ..Material::default() }
    }

    fn forms() -> Vec<Form> {
        let tree = |rank, log2_resolution| Form::TensorTree { rank, log2_resolution, tolerance: 0.01 };
        let klems = [Klems::Full, Klems::Half, Klems::Quarter].map(Form::Klems);
        klems.into_iter().chain([tree(3, 5), tree(4, 3)]).collect()
    }

    #[test]
    fn visible_is_cie_y_under_d65() {
        let mut losses = Vec::new();
        // A linear reflectance sampled at its two ends is exact between them.
        let bands = [Band::nm(780.0), Band::nm(380.0)];
        let w = visible_weights(&bands, &mut losses).unwrap();
        let d65 = Illuminant::D65.spectrum().unwrap();
        let y = |f: &dyn Fn(f64) -> f64| -> f64 {
            (380..=780)
                .map(f64::from)
                .map(|l| f(l) * f64::from(d65.at(l as f32)) * Observer::Cie1931.cmf(l as f32)[1])
                .sum()
        };
        let exact = y(&|l| (l - 380.0) / 400.0) / y(&|_| 1.0);
        assert!((w[0] - exact).abs() < 1e-12 && (w[0] + w[1] - 1.0).abs() < 1e-12, "{w:?} {exact}");
        // Green counts most; beyond the ends the end bands hold.
        let w = visible_weights(&[450.0, 550.0, 650.0].map(Band::nm), &mut losses).unwrap();
        assert!(w[1] > 0.6 && w[1] < 0.8 && losses.is_empty(), "{w:?}");
        let w = visible_weights(&["B", "G", "R"].map(Band::named), &mut losses).unwrap();
        assert_eq!((w, losses.len()), (vec![0.0722, 0.7152, 0.2126], 1));
        let w = visible_weights(&["Solar", "CIE-Y"].map(Band::named), &mut losses).unwrap();
        assert_eq!(w, [0.0, 1.0]);
        let w = visible_weights(&["a", "b"].map(Band::named), &mut losses).unwrap();
        assert_eq!((w, losses.len()), (vec![0.5, 0.5], 2));
    }

    #[test]
    fn round_trips() {
        let sheet = Sheet::new(0.4, 0.1, 0.3);
        for form in forms() {
            let written = write(&sheet, form, &material()).unwrap();
            assert!(written.losses.is_empty(), "{form:?}: {:?}", written.losses);
            let back = read(written.text.as_bytes(), "x.xml").unwrap();
            assert_eq!((back.name.as_str(), back.notes.len()), ("a <petal> & more", 0));
            assert_eq!(back.coverage(), sheet.coverage());
            let names: Vec<&str> = back.bands().iter().map(|b| b.name.as_str()).collect();
            assert_eq!(names, ["CIE-Y", "450 nm", "650 nm"]);
            assert_eq!(back.is_isotropic(), matches!(form, Form::TensorTree { rank: 3, .. }));
            let (mut values, mut own) = (vec![0.0; 3], vec![0.0; 2]);
            // The written value is a mean over a patch: 0.1 1/sr of highlight varies by less than this within one.
            let slack = match form {
                Form::Klems(Klems::Full) => 0.02,
                Form::Klems(_) => 0.04,
                Form::TensorTree { rank: 3, .. } => 0.01,
                Form::TensorTree { .. } => 0.07,
            };
            // Totals are the source's, averaged over the incident patch.
            let close = match form {
                Form::Klems(Klems::Full) => 0.005,
                Form::TensorTree { rank: 3, .. } => 0.01,
                Form::Klems(_) => 0.02,
                Form::TensorTree { .. } => 0.04,
            };
            for (ti, pi) in
                [(0.0, 0.0), (20.0, 15.0), (35.0, 100.0), (60.0, 250.0), (120.0, 10.0), (170.0, 200.0)]
            {
                for (to, po) in [(10.0, 0.0), (35.0, 280.0), (60.0, 70.0), (100.0, 30.0), (150.0, 20.0)] {
                    let (wi, wo) = (direction_deg(ti, pi), direction_deg(to, po));
                    assert!(back.bsdf(wi, wo, &mut values) && sheet.bsdf(wi, wo, &mut own));
                    let error = (values[2] - own[1]).abs();
                    assert!(error < slack, "{form:?} {ti} {pi} {to} {po}: {values:?} {own:?}");
                    let exact_through = wi.z * wo.z > 0.0 || error < 1e-4 * own[1];
                    assert!(exact_through, "{form:?}: {values:?} {own:?}");
                }
            }
            for theta_deg in [0.0, 30.0, 60.0, 150.0] {
                let wi = direction_deg(theta_deg, 33.0);
                for side in [Side::Adaxial, Side::Abaxial] {
                    let own = directional_hemispherical(&sheet, wi, side, (24, 48));
                    let read = directional_hemispherical(&back, wi, side, (180, 360));
                    for (own, read) in own.iter().zip(&read[1..]) {
                        assert!(
                            (read / own - 1.0).abs() < close,
                            "{form:?} {theta_deg} {side:?}: {own} {read}"
                        );
                    }
                }
            }
        }
    }

    /// Scatters only into a narrow lobe: around the mirror's direction, the lamp's, or one to the side.
    struct Lobe {
        bands: Vec<Band>,
        turn_deg: f64,
        through: bool,
    }

    impl Directional for Lobe {
        fn bands(&self) -> &[Band] {
            &self.bands
        }
        fn coverage(&self) -> Coverage {
            let (r, t) = (!self.through, self.through);
            Coverage {
                reflection_adaxial: r,
                reflection_abaxial: r,
                transmission_adaxial: t,
                transmission_abaxial: false,
            }
        }
        fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
            let (s, c) = self.turn_deg.to_radians().sin_cos();
            let axis = DVec3::new(c * wi.x - s * wi.y, s * wi.x + c * wi.y, wi.z.abs());
            values[0] = axis.dot(DVec3::new(wo.x, wo.y, wo.z.abs())).max(0.0).powi(200);
            true
        }
    }

    #[test]
    fn a_lobe_lands_where_it_belongs() {
        for form in [forms()[0], forms()[3], forms()[4]] {
            for turn_deg in [0.0, 90.0, 180.0] {
                for through in [false, true] {
                    let lobe = Lobe { bands: vec![Band::nm(550.0)], turn_deg, through };
                    let written = write(&lobe, form, &material()).unwrap();
                    let back = read(written.text.as_bytes(), "x.xml").unwrap();
                    let (mut best, mut at) = (0.0, 0.0);
                    let mut values = [0.0; 2];
                    for phi in 0..72 {
                        let phi_deg = f64::from(phi) * 5.0;
                        let wo = direction_deg(if through { 130.0 } else { 50.0 }, phi_deg);
                        assert!(back.bsdf(direction_deg(50.0, 30.0), wo, &mut values));
                        if values[0] > best {
                            (best, at) = (values[0], phi_deg);
                        }
                    }
                    let off = (at - 30.0 - turn_deg + 540.0).rem_euclid(360.0) - 180.0;
                    assert!(off.abs() <= 30.0, "{form:?} {turn_deg} {through}: {at}");
                    assert_eq!(back.coverage().transmission_abaxial, through);
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_written_is_said() {
        let lobe = Lobe { bands: vec![Band::nm(550.0)], turn_deg: 0.0, through: true };
        let written = write(&lobe, Form::Klems(Klems::Quarter), &Material::default()).unwrap();
        let all = written.losses.join("; ");
        for what in [
            "Visible is the band of 550 nm",
            "Transmission Front was written as the reverse",
            "Reflection Front is not known",
            "Reflection Back is not known",
            "thickness",
        ] {
            assert!(all.contains(what), "{what} is missing from: {all}");
        }
        let bright = Sheet::new(0.9, 0.3, 0.0);
        let written = write(&bright, Form::Klems(Klems::Quarter), &material()).unwrap();
        assert!(written.losses.iter().any(|l| l.contains("more than arrives")), "{:?}", written.losses);
        let nothing = Lobe { bands: Vec::new(), turn_deg: 0.0, through: true };
        assert!(write(&nothing, Form::default(), &material()).is_err());
        for (rank, log2_resolution, tolerance) in [(2, 3, 0.01), (3, 8, 0.01), (4, 6, 0.01), (3, 3, f64::NAN)]
        {
            assert!(
                write(&lobe, Form::TensorTree { rank, log2_resolution, tolerance }, &material()).is_err()
            );
        }
    }

    /// Files for `scripts/foreign_radiance.py`, into the folder of the environment variable `OUT`.
    #[test]
    #[ignore = "writes files for another program's reader"]
    fn write_files_for_radiance() {
        let folder = std::env::var("OUT").unwrap();
        let sheet = Sheet::new(0.4, 0.1, 0.3);
        let tree = |rank, log2_resolution| Form::TensorTree { rank, log2_resolution, tolerance: 0.01 };
        for (name, form) in [
            ("klems", Form::Klems(Klems::Full)),
            ("klems_half", Form::Klems(Klems::Half)),
            ("klems_quarter", Form::Klems(Klems::Quarter)),
            ("ttree", tree(3, 5)),
            ("ttree4", tree(4, 4)),
        ] {
            let save = |start: &str, source: &dyn Directional| {
                let text = write(source, form, &material()).unwrap().text;
                std::fs::write(format!("{folder}/{start}_{name}.xml"), text).unwrap();
            };
            save("sheet", &sheet);
            for (start, turn_deg, through) in [
                ("mirror", 180.0, false),
                ("retro", 0.0, false),
                ("side", 90.0, false),
                ("straight", 180.0, true),
            ] {
                save(start, &Lobe { bands: vec![Band::nm(550.0)], turn_deg, through });
            }
        }
    }
}
