//! Radiance and WINDOW BSDF XML: reading.
//!
//! A document holds, per wavelength or spectral integral, up to four blocks: transmission and reflection, front and back,
//! each a Klems [`Matrix`] or a [`TensorTree`]. Values are 1/sr, without the cosine.
//!
//! **Sides.** The frame of the numbers is that of Radiance, whose +z side is what the format calls *back*. It is our frame,
//! +z adaxial, so `Reflection Back` is the adaxial side's and `Transmission Front` is light from the abaxial side
//! ([`Part::xml_name`]). Then x and y need no turning, and a petal whose normal is adaxial looks in Radiance as it does here.
//!
//! | in the file | here |
//! |---|---|
//! | `Wavelength` `Visible` | band `CIE-Y` |
//! | `Solar`, `NIR`, `CIE-X`, `CIE-Z`, any name | band of this name |
//! | `<Wavelength unit="Nanometer">550` | band of 550 nm |
//! | `CIE-u`, `CIE-v` (chromaticities of trees) | left out, with a note |
//!
//! Transmission in one direction only answers for both: a sheet that begins and ends in air is reciprocal.
//! Bands that lack a part which the fullest band has are left out, with a note. Definitions of angle bases in the file win over
//! the built-in ones. Counts of numbers are checked before memory is taken. Guarded by `damaged_files_are_errors`,
//! `wrong_documents_name_the_line`. Written by [`super::window_xml_write`].

use glam::DVec3;

use super::klems::{AngleBasis, Matrix};
use super::tensor_tree::TensorTree;
use super::xml::{self, Element, excerpt};
use crate::gonio::{Band, Coverage, Directional};
use crate::{Error, Result};

/// The four parts of a BSDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Lit and seen from the adaxial side.
    ReflectionAdaxial,
    /// Lit and seen from the abaxial side.
    ReflectionAbaxial,
    /// Lit from the adaxial side, seen from the other.
    TransmissionAdaxial,
    /// Lit from the abaxial side, seen from the other.
    TransmissionAbaxial,
}

impl Part {
    /// All, in the order in which they are written.
    pub const ALL: [Part; 4] = [
        Part::TransmissionAbaxial,
        Part::TransmissionAdaxial,
        Part::ReflectionAbaxial,
        Part::ReflectionAdaxial,
    ];

    /// The part that two directions belong to.
    pub fn of(wi: DVec3, wo: DVec3) -> Self {
        match (wi.z > 0.0, wo.z > 0.0) {
            (true, true) => Part::ReflectionAdaxial,
            (false, false) => Part::ReflectionAbaxial,
            (true, false) => Part::TransmissionAdaxial,
            (false, true) => Part::TransmissionAbaxial,
        }
    }

    /// `WavelengthDataDirection` in the file.
    pub fn xml_name(self) -> &'static str {
        match self {
            Part::ReflectionAdaxial => "Reflection Back",
            Part::ReflectionAbaxial => "Reflection Front",
            Part::TransmissionAdaxial => "Transmission Back",
            Part::TransmissionAbaxial => "Transmission Front",
        }
    }

    /// Signs of z of the lamp's and of the viewer's direction.
    pub fn signs(self) -> (f64, f64) {
        match self {
            Part::ReflectionAdaxial => (1.0, 1.0),
            Part::ReflectionAbaxial => (-1.0, -1.0),
            Part::TransmissionAdaxial => (1.0, -1.0),
            Part::TransmissionAbaxial => (-1.0, 1.0),
        }
    }

    /// The same part with lamp and viewer exchanged.
    pub fn reversed(self) -> Self {
        match self {
            Part::TransmissionAdaxial => Part::TransmissionAbaxial,
            Part::TransmissionAbaxial => Part::TransmissionAdaxial,
            same => same,
        }
    }

    fn index(self) -> usize {
        self as usize
    }
}

/// Numbers of one block.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// Patches of fixed size.
    Matrix(Matrix),
    /// Boxes of any size.
    Tree(TensorTree),
}

impl Block {
    fn at(&self, wi: DVec3, wo: DVec3) -> f64 {
        match self {
            Block::Matrix(m) => m.at(wi, wo),
            Block::Tree(t) => t.at(wi, wo),
        }
    }
}

/// A BSDF as read.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowBsdf {
    /// `Material`'s name.
    pub name: String,
    /// `Material`'s manufacturer.
    pub manufacturer: String,
    /// What was left out, for the user.
    pub notes: Vec<String>,
    bands: Vec<Band>,
    /// Per [`Part`], empty or one block per band.
    parts: [Vec<Block>; 4],
}

impl WindowBsdf {
    /// The blocks of a part, one per band; empty where the file has none.
    pub fn blocks(&self, part: Part) -> &[Block] {
        &self.parts[part.index()]
    }
}

impl Directional for WindowBsdf {
    fn bands(&self) -> &[Band] {
        &self.bands
    }

    fn coverage(&self) -> Coverage {
        let has = |part: Part| !self.parts[part.index()].is_empty();
        let through = has(Part::TransmissionAdaxial) || has(Part::TransmissionAbaxial);
        Coverage {
            reflection_adaxial: has(Part::ReflectionAdaxial),
            reflection_abaxial: has(Part::ReflectionAbaxial),
            transmission_adaxial: through,
            transmission_abaxial: through,
        }
    }

    fn is_isotropic(&self) -> bool {
        self.parts.iter().flatten().all(|b| matches!(b, Block::Tree(t) if t.rank == 3))
    }

    fn bsdf(&self, wi: DVec3, wo: DVec3, values: &mut [f64]) -> bool {
        let part = Part::of(wi, wo);
        let (blocks, wi, wo) = match self.blocks(part) {
            [] => (self.blocks(part.reversed()), wo, wi),
            blocks => (blocks, wi, wo),
        };
        values.iter_mut().enumerate().for_each(|(i, v)| *v = blocks.get(i).map_or(0.0, |b| b.at(wi, wo)));
        !blocks.is_empty()
    }
}

/// One number of `ScatteringData`.
pub(super) fn value_per_sr(token: &str) -> Result<f32, String> {
    match token.parse::<f32>() {
        Ok(v) if v.is_finite() && v >= 0.0 => Ok(v),
        Ok(v) if v < 0.0 && v.is_finite() => Err(format!("`{}`: a BSDF is not negative", excerpt(token))),
        _ => Err(format!("`{}` is not a finite number", excerpt(token))),
    }
}

/// How the numbers of all blocks are arranged.
#[derive(Clone, Copy, PartialEq)]
enum Layout {
    Columns,
    Rows,
    Tree(usize),
}

/// Reads a document; `name` is the file's in errors.
pub fn read(bytes: &[u8], name: &str) -> Result<WindowBsdf> {
    let root = xml::parse(bytes, name)?;
    let reader = Reader { name };
    let layer = root.child("Optical").and_then(|o| o.child("Layer"));
    let Some(layer) = layer.filter(|_| root.name == "WindowElement") else {
        return reader.fail(root.line, "expected WindowElement with Optical and Layer in it");
    };
    reader.layer(layer)
}

/// What errors and look-ups need.
struct Reader<'a> {
    name: &'a str,
}

impl Reader<'_> {
    fn fail<T>(&self, line: usize, what: impl Into<String>) -> Result<T> {
        Err(Error::invalid(format!("{}:{line}", self.name), what))
    }

    fn layer(&self, layer: &Element) -> Result<WindowBsdf> {
        let Some(definition) = layer.child("DataDefinition") else {
            return self.fail(layer.line, "DataDefinition is missing");
        };
        let structure = definition.text_of("IncidentDataStructure");
        let layout = match structure.to_ascii_lowercase().as_str() {
            "columns" => Layout::Columns,
            "rows" => Layout::Rows,
            "tensortree3" => Layout::Tree(3),
            "tensortree4" => Layout::Tree(4),
            _ => {
                let what = format!(
                    "IncidentDataStructure `{}`: expected Columns, Rows, TensorTree3 or TensorTree4",
                    excerpt(structure)
                );
                return self.fail(definition.line, what);
            }
        };
        let bases: Vec<AngleBasis> =
            definition.all("AngleBasis").map(|e| self.basis(e)).collect::<Result<_>>()?;
        let mut notes = Vec::new();
        let mut found: Vec<(Band, [Option<Block>; 4])> = Vec::new();
        for data in layer.all("WavelengthData") {
            let Some(band) = self.band(data)? else {
                notes.push(format!("`{}` holds chromaticities, not a BSDF", data.text_of("Wavelength")));
                continue;
            };
            let slot = match found.iter().position(|f| f.0 == band) {
                Some(i) => i,
                None => {
                    found.push((band, Default::default()));
                    found.len() - 1
                }
            };
            for block in data.all("WavelengthDataBlock") {
                let direction = block.text_of("WavelengthDataDirection");
                let Some(part) = Part::ALL.into_iter().find(|p| p.xml_name().eq_ignore_ascii_case(direction))
                else {
                    notes.push(format!(
                        "`{}` is not a part of a BSDF that is read (line {})",
                        excerpt(direction),
                        block.line
                    ));
                    continue;
                };
                let values = self.block(block, layout, &bases, &mut notes)?;
                if found[slot].1[part.index()].replace(values).is_some() {
                    return self
                        .fail(block.line, format!("a second `{direction}` of `{}`", found[slot].0.name));
                }
            }
        }
        let material =
            |key: &str| layer.child("Material").map_or(String::new(), |m| m.text_of(key).to_string());
        let mut bsdf = WindowBsdf {
            name: material("Name"),
            manufacturer: material("Manufacturer"),
            notes,
            bands: Vec::new(),
            parts: Default::default(),
        };
        // The first of the fullest bands says which parts there are.
        let count = |f: &(Band, [Option<Block>; 4])| f.1.iter().flatten().count();
        let most = found.iter().map(count).max().unwrap_or(0);
        let Some(fullest) = found.iter().find(|f| count(f) == most && most > 0) else {
            return self.fail(layer.line, "there are no scattering data");
        };
        let known: [bool; 4] = std::array::from_fn(|p| fullest.1[p].is_some());
        for (band, blocks) in found {
            if (0..4).any(|p| known[p] && blocks[p].is_none()) {
                bsdf.notes.push(format!("band {} lacks parts that others have, and was left out", band.name));
                continue;
            }
            bsdf.bands.push(band);
            for (p, block) in blocks.into_iter().enumerate().filter(|(p, _)| known[*p]) {
                bsdf.parts[p].extend(block);
            }
        }
        Ok(bsdf)
    }

    /// The band; `None` for chromaticities.
    fn band(&self, data: &Element) -> Result<Option<Band>> {
        let Some(wavelength) = data.child("Wavelength") else {
            return self.fail(data.line, "Wavelength is missing");
        };
        let text = wavelength.text.trim();
        let scale_nm = match wavelength.unit.to_ascii_lowercase().as_str() {
            "nanometer" | "nanometers" | "nm" => 1.0,
            "micrometer" | "micron" | "um" => 1000.0,
            _ => {
                return Ok(match text.to_ascii_lowercase().as_str() {
                    "" => return self.fail(wavelength.line, "Wavelength is empty"),
                    "visible" => Some(Band::named("CIE-Y")),
                    "cie-u" | "cie-v" => None,
                    _ => Some(Band::named(excerpt(text))),
                });
            }
        };
        match text.parse::<f64>() {
            Ok(v) if v.is_finite() && v > 0.0 => Ok(Some(Band::nm(v * scale_nm))),
            _ => self.fail(wavelength.line, format!("`{}` is not a wavelength", excerpt(text))),
        }
    }

    fn basis(&self, element: &Element) -> Result<AngleBasis> {
        let (mut theta_max_deg, mut n_phi, mut last) = (Vec::new(), Vec::new(), 0.0);
        for block in element.all("AngleBasisBlock") {
            let bounds = block.child("ThetaBounds");
            let theta = |key: &str| bounds.and_then(|b| b.text_of(key).parse::<f64>().ok());
            let (Some(low), Some(high)) = (theta("LowerTheta"), theta("UpperTheta")) else {
                return self.fail(block.line, "ThetaBounds with LowerTheta and UpperTheta expected");
            };
            // Old files give the cap from minus its half width.
            if !n_phi.is_empty() && (low - last).abs() > 1e-4 {
                return self.fail(block.line, format!("LowerTheta {low} after UpperTheta {last}"));
            }
            let Ok(n) = block.text_of("nPhis").parse::<usize>() else {
                return self.fail(block.line, "nPhis is not a count");
            };
            last = high;
            theta_max_deg.push(high);
            n_phi.push(n);
        }
        AngleBasis::new(element.text_of("AngleBasisName"), theta_max_deg, n_phi)
            .or_else(|e| self.fail(element.line, e.to_string()))
    }

    fn block(
        &self,
        block: &Element,
        layout: Layout,
        bases: &[AngleBasis],
        notes: &mut Vec<String>,
    ) -> Result<Block> {
        let Some(data) = block.child("ScatteringData") else {
            return self.fail(block.line, "ScatteringData is missing");
        };
        let line_at = |at: usize| {
            data.text_line + data.text.as_bytes().iter().take(at).filter(|b| **b == b'\n').count()
        };
        if let Layout::Tree(rank) = layout {
            let basis = block.text_of("AngleBasis");
            if !basis.eq_ignore_ascii_case("LBNL/Shirley-Chiu") {
                let what = format!("angle basis `{}`: expected LBNL/Shirley-Chiu", excerpt(basis));
                return self.fail(block.line, what);
            }
            return match TensorTree::parse(rank, &data.text) {
                Ok(tree) => Ok(Block::Tree(tree)),
                Err((at, what)) => self.fail(line_at(at), what),
            };
        }
        // A number and what separates it from the next take two bytes.
        let mut values = Vec::with_capacity(data.text.len() / 8);
        for token in data.text.split(|c: char| c.is_ascii_whitespace() || c == ',').filter(|t| !t.is_empty())
        {
            match value_per_sr(token) {
                Ok(v) => values.push(v),
                Err(what) => {
                    return self.fail(line_at(token.as_ptr() as usize - data.text.as_ptr() as usize), what);
                }
            }
        }
        let find = |key: &str| -> Result<Vec<AngleBasis>> {
            let name = block.text_of(key);
            let defined: Vec<_> =
                bases.iter().filter(|b| b.name.eq_ignore_ascii_case(name)).cloned().collect();
            let all = if defined.is_empty() { AngleBasis::named(name) } else { defined };
            if all.is_empty() {
                return self.fail(block.line, format!("{key} `{}` is not defined", excerpt(name)));
            }
            Ok(all)
        };
        let (columns, rows) = (find("ColumnAngleBasis")?, find("RowAngleBasis")?);
        // Names without a definition can mean two revisions; the count of numbers tells Half's apart.
        let pair = columns
            .iter()
            .flat_map(|c| rows.iter().map(move |r| (c, r)))
            .filter(|(c, r)| c.len() * r.len() == values.len() && (c.name != r.name || c == r))
            .collect::<Vec<_>>();
        let Some(&(columns, rows)) = pair.first() else {
            let (c, r) = (columns[0].len(), rows[0].len());
            let what = format!("{} numbers, expected {c} x {r} = {}", values.len(), c * r);
            return self.fail(data.line, what);
        };
        if pair.len() > 1 && columns.n_phi.len() > 1 && pair.iter().any(|p| p.0 != columns) {
            let note = format!("`{}` is not defined in the file: read as Radiance reads it", columns.name);
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        if layout == Layout::Rows {
            let (n_in, n_out) = (columns.len(), rows.len());
            values = (0..n_in * n_out).map(|k| values[k % n_in * n_out + k / n_in]).collect();
        }
        Ok(Block::Matrix(Matrix { columns: columns.clone(), rows: rows.clone(), values_per_sr: values }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::measurement::direction_deg;
    use crate::io::damage::damage;

    /// A document of two rings (1 and 2 patches) with the given parts of `DataDefinition` and of the layer.
    fn document(definition: &str, data: &str) -> String {
        format!(
            "<?xml version=\"1.0\"?>\n<WindowElement xmlns=\"http://windows.lbl.gov\">\n<Optical><Layer>\n\
             <Material><Name>n</Name><Manufacturer>m</Manufacturer></Material>\n\
             <DataDefinition>{definition}</DataDefinition>\n{data}</Layer></Optical></WindowElement>\n"
        )
    }

    const BASIS: &str = "<AngleBasis><AngleBasisName>Two</AngleBasisName>\
        <AngleBasisBlock><Theta>0</Theta><nPhis>1</nPhis><ThetaBounds><LowerTheta>-30</LowerTheta>\
        <UpperTheta>30</UpperTheta></ThetaBounds></AngleBasisBlock>\
        <AngleBasisBlock><Theta>60</Theta><nPhis>2</nPhis><ThetaBounds><LowerTheta>30</LowerTheta>\
        <UpperTheta>90</UpperTheta></ThetaBounds></AngleBasisBlock></AngleBasis>";

    fn columns(structure: &str) -> String {
        format!("<IncidentDataStructure>{structure}</IncidentDataStructure>\n{BASIS}")
    }

    fn data(wavelength: &str, part: &str, numbers: &str) -> String {
        format!(
            "<WavelengthData><LayerNumber>System</LayerNumber>{wavelength}<WavelengthDataBlock>\n\
             <WavelengthDataDirection>{part}</WavelengthDataDirection><ColumnAngleBasis>two</ColumnAngleBasis>\n\
             <RowAngleBasis>Two</RowAngleBasis><AngleBasis>LBNL/Shirley-Chiu</AngleBasis>\n\
             <ScatteringData>\n{numbers}</ScatteringData></WavelengthDataBlock></WavelengthData>\n"
        )
    }

    const VISIBLE: &str = "<Wavelength unit=\"Integral\">Visible</Wavelength>";
    const NM: &str = "<Wavelength unit=\"Nanometer\">550</Wavelength>";
    const NUMBERS: &str = "0, 1, 2,\n3, 4, 5\n6 7 8\n";

    fn value(bsdf: &WindowBsdf, wi: (f64, f64), wo: (f64, f64)) -> Option<f64> {
        let mut values = vec![0.0; bsdf.bands().len()];
        bsdf.bsdf(direction_deg(wi.0, wi.1), direction_deg(wo.0, wo.1), &mut values).then_some(values[0])
    }

    #[test]
    fn rows_are_exitant_and_columns_the_way_of_the_light() {
        let text = document(&columns("Columns"), &data(VISIBLE, "Reflection Back", NUMBERS));
        let bsdf = read(text.as_bytes(), "f").unwrap();
        // Light from azimuth 0 travels towards 180: column 2. It leaves towards 0: row 1.
        assert_eq!(value(&bsdf, (60.0, 0.0), (60.0, 0.0)), Some(5.0));
        assert_eq!(value(&bsdf, (60.0, 0.0), (10.0, 0.0)), Some(2.0));
        assert_eq!(value(&bsdf, (10.0, 0.0), (60.0, 180.0)), Some(6.0));
        // Back is the adaxial side; the other parts are not known.
        assert_eq!(value(&bsdf, (170.0, 0.0), (170.0, 0.0)), None);
        assert_eq!(bsdf.coverage(), Coverage { reflection_adaxial: true, ..Coverage::default() });
        assert_eq!((bsdf.bands()[0].name.as_str(), bsdf.is_isotropic()), ("CIE-Y", false));
        let rows = document(&columns("Rows"), &data(VISIBLE, "Reflection Back", NUMBERS));
        let rows = read(rows.as_bytes(), "f").unwrap();
        assert_eq!(value(&rows, (60.0, 0.0), (60.0, 0.0)), Some(7.0));
    }

    #[test]
    fn one_direction_of_transmission_answers_for_both() {
        let text = document(&columns("Columns"), &data(NM, "Transmission Front", NUMBERS));
        let bsdf = read(text.as_bytes(), "f").unwrap();
        assert_eq!(bsdf.bands(), [Band::nm(550.0)]);
        // From below, azimuth 0 (column 2), to the pole (row 0), and the reverse.
        assert_eq!(value(&bsdf, (120.0, 0.0), (5.0, 0.0)), Some(2.0));
        assert_eq!(value(&bsdf, (5.0, 0.0), (120.0, 0.0)), Some(2.0));
        assert!(bsdf.coverage().transmission_adaxial && bsdf.coverage().transmission_abaxial);
    }

    #[test]
    fn bands_without_all_parts_are_noted() {
        let all = [
            data(VISIBLE, "Reflection Back", NUMBERS),
            data(VISIBLE, "Reflection Front", NUMBERS),
            data(NM, "Reflection Back", NUMBERS),
            data("<Wavelength unit=\"Integral\">CIE-u</Wavelength>", "Reflection Back", NUMBERS),
            data(VISIBLE, "Absorption", NUMBERS),
        ];
        let bsdf = read(document(&columns("Columns"), &all.concat()).as_bytes(), "f").unwrap();
        assert_eq!((bsdf.bands().len(), bsdf.notes.len()), (1, 3), "{:?}", bsdf.notes);
    }

    #[test]
    fn revisions_of_half_are_told_apart() {
        let half = |n: usize| {
            let numbers = "0.1 ".repeat(n * n);
            let block = data(VISIBLE, "Reflection Back", &numbers)
                .replace("two", "LBNL/Klems Half")
                .replace("Two", "LBNL/Klems Half");
            read(document("<IncidentDataStructure>Columns</IncidentDataStructure>", &block).as_bytes(), "f")
        };
        for n in [73, 77] {
            let bsdf = half(n).unwrap();
            let Block::Matrix(m) = &bsdf.blocks(Part::ReflectionAdaxial)[0] else { panic!() };
            assert_eq!((m.rows.len(), m.columns.len()), (n, n));
        }
        assert!(half(75).unwrap_err().to_string().contains("expected 77 x 77"));
    }

    #[test]
    fn wrong_documents_name_the_line() {
        let good = document(&columns("Columns"), &data(VISIBLE, "Reflection Back", NUMBERS));
        assert!(read(good.as_bytes(), "f").is_ok());
        let tree = document(
            "<IncidentDataStructure>TensorTree3</IncidentDataStructure>",
            &data(VISIBLE, "Reflection Back", "{\n0.5\n}"),
        );
        assert!(read(tree.as_bytes(), "f").unwrap().is_isotropic());
        for (text, line, why) in [
            (good.replace("3, 4", "3, nan"), 12, "not a finite number"),
            (good.replace("3, 4", "3, -4"), 12, "not negative"),
            (good.replace("3, 4", "3, 1e400"), 12, "not a finite number"),
            (good.replace("6 7 8", "6 7"), 10, "8 numbers, expected 3 x 3"),
            (good.replace("6 7 8", "6 7 8 9"), 10, "10 numbers"),
            (good.replace(">two<", ">three<"), 7, "not defined"),
            (good.replace("Columns<", "Diagonal<"), 5, "IncidentDataStructure"),
            (good.replace("<nPhis>2", "<nPhis>999999999999"), 6, "patches"),
            (good.replace("<nPhis>2", "<nPhis>-2"), 6, "nPhis"),
            (good.replace("<LowerTheta>30", "<LowerTheta>40"), 6, "LowerTheta"),
            (good.replace("<UpperTheta>90", "<UpperTheta>inf"), 6, "upper angle"),
            (good.replace(VISIBLE, ""), 7, "Wavelength"),
            (good.replace(VISIBLE, "<Wavelength unit=\"Nanometer\">red</Wavelength>"), 7, "wavelength"),
            (good.replace("Reflection Back", "Sideways"), 3, "no scattering data"),
            (good.replace("WindowElement", "Window"), 2, "WindowElement"),
            (tree.replace("0.5", "0.5 0.5"), 12, "2 numbers"),
            (tree.replace("0.5", "x"), 11, "not a finite number"),
            (tree.replace("LBNL/Shirley-Chiu", "other"), 6, "angle basis"),
        ] {
            let message = read(text.as_bytes(), "f").unwrap_err().to_string();
            assert!(
                message.starts_with(&format!("f:{line}: ")) && message.contains(why),
                "{line} {why}: {message}"
            );
        }
    }

    #[test]
    fn damaged_files_are_errors() {
        let all = [
            data(VISIBLE, "Reflection Back", NUMBERS),
            data(NM, "Reflection Back", NUMBERS),
            data(NM, "Transmission Front", NUMBERS),
        ];
        let klems = document(&columns("Columns"), &all.concat());
        let tree = data(
            VISIBLE,
            "Reflection Back",
            "{{1}{2}{3}{4}{0 0 0 0 0 0 0 0}{6}{{1}{2}{3}{4}{5}{6}{7}{8}}{8}}",
        );
        let tree = document("<IncidentDataStructure>TensorTree3</IncidentDataStructure>", &tree);
        assert!(read(tree.as_bytes(), "f").is_ok());
        for text in [klems, tree] {
            damage(text.as_bytes(), 2000, |bytes| {
                if let Ok(bsdf) = read(bytes, "f") {
                    let v = value(&bsdf, (40.0, 10.0), (50.0, 100.0)).unwrap_or(0.0);
                    assert!(v.is_finite() && v >= 0.0);
                }
            });
        }
    }
}
