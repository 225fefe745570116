//! Petals of a scene: shaded from cells, or from the tables of a measured tissue.
//!
//! Model of a tabulated petal: [`TabulatedBsdf`] with the pigments of both epidermes times
//!
//! ```text
//! c(u, v) = (claw + (rim - claw) s(v)) t(u, v) pattern,   s(v) = v^2 (3 - 2 v)
//! ```
//!
//! | symbol | key | unit | default |
//! |---|---|---|---|
//! | claw, rim | `petal.gradient` | pure numbers | 1 |
//! | t | `petal.texture`, its luminance, bilinear, held beyond its border | pure number | 1 |
//! | pattern: of each epidermis its own | `petal.pattern`, see [`super::pattern`] | pure number | 1 |
//! | v | texture coordinate, 0 at the claw, 1 at the tip of the rim | | 0 |
//!
//! A petal that thins out or withers is up to three tissues, each measured or coloured by itself: as thick as it gets, as thin, and
//! withered. A place is a mixture of them, so its BSDF is the mean of theirs by their shares; paths follow one of them, picked as often as
//! there is of it. Withered tissue takes no part in patterns of pigment.
//!
//! Guarded by `places_mix_what_they_are_made_of`, `thickness_is_nearly_linear`, `pigment_follows_gradient_and_texture`, `optics_must_be_of_the_same_shape`.
//! Source: our reading.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use serde::Serialize;

use super::assets::Assets;
use super::description::{GradientDescription, PetalDescription, WitheredDescription};
use super::key::Key;
use super::pattern::{Pattern, PigmentFactors, TissueState};
use crate::flower::PetalMap;
use crate::gonio::tabulated::measured_tissue;
use crate::gonio::{AtPigment, PetalOptics, TabulatedBsdf, WhiteMonteCarlo};
use crate::io;
use crate::micro::shading::CellPetal;
use crate::micro::{CellDescription, CellWalk, REGIONS, Tissue, TissueDescription};
use crate::spectrum::color::luminance;
use crate::spectrum::{Pigments, SampledSpectrum, SampledWavelengths};
use crate::{Error, Result};

/// What shades a petal.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "a scene has one, behind an Arc")]
pub enum Petal {
    /// The thesis' coefficients on points of the cells.
    Cells(CellPetal),
    /// Tables of a measured tissue.
    Tabulated(TabulatedPetal),
}

impl Petal {
    /// Share of the light from the local direction `wi` that crosses the sheet.
    pub fn transmittance(
        &self,
        wi: Vec3,
        state: TissueState,
        lambda: &SampledWavelengths,
    ) -> SampledSpectrum {
        match self {
            Petal::Cells(petal) => petal.transmittance(lambda),
            Petal::Tabulated(petal) => petal.albedo(wi, state, lambda)[1],
        }
    }

    /// Colour seen from the local direction `wo`, transmitted light included.
    pub fn albedo(&self, wo: Vec3, state: TissueState, lambda: &SampledWavelengths) -> SampledSpectrum {
        match self {
            Petal::Cells(petal) => petal.albedo(wo, lambda) + petal.transmittance(lambda),
            Petal::Tabulated(petal) => {
                let [reflected, transmitted] = petal.albedo(wo, state, lambda);
                reflected + transmitted
            }
        }
    }
}

/// A tabulated petal whose pigment, thickness and health vary.
#[derive(Clone, Debug)]
pub struct TabulatedPetal {
    /// As thick as it gets.
    bsdf: TabulatedBsdf,
    /// As thin as it gets.
    thin: Option<TabulatedBsdf>,
    withered: Option<TabulatedBsdf>,
    gradient: GradientDescription,
    pattern: Option<Pattern>,
    texture: Option<Texture>,
}

impl TabulatedPetal {
    /// The BSDF of the thick tissue where the pigments of the epidermes are so many times those of the tissue, for the wavelengths
    /// of a path.
    pub fn at(&self, pigment: PigmentFactors, lambda: &SampledWavelengths) -> AtPigment<'_> {
        self.bsdf.at(scales(pigment), lambda)
    }

    /// The k-th of the tissues of [`TissueState::shares`], for the wavelengths of a path.
    pub(super) fn tissue(
        &self,
        k: usize,
        pigment: PigmentFactors,
        lambda: &SampledWavelengths,
    ) -> AtPigment<'_> {
        match (k, &self.thin, &self.withered) {
            (1, Some(thin), _) => thin.at(scales(pigment), lambda),
            (2, _, Some(withered)) => withered.at([1.0; REGIONS], lambda),
            _ => self.at(pigment, lambda),
        }
    }

    /// Which of the tissues there are.
    pub(super) fn tissues(&self) -> [bool; 3] {
        [true, self.thin.is_some(), self.withered.is_some()]
    }

    /// One of the tissues of a place, each as often as there is of it if `u` is uniform in [0, 1).
    pub fn pick(&self, state: TissueState, lambda: &SampledWavelengths, u: f32) -> AtPigment<'_> {
        let [thick, thin, _] = state.shares();
        let k = if u < thick { 0 } else { 1 + usize::from(u >= thick + thin) };
        self.tissue(k, state.pigment, lambda)
    }

    /// Is every place of one tissue?
    pub fn is_pure(&self) -> bool {
        self.thin.is_none() && self.withered.is_none()
    }

    /// Shares of the light from a local direction that leave on its side and on the other, where the petal is in a state.
    pub fn albedo(&self, wo: Vec3, state: TissueState, lambda: &SampledWavelengths) -> [SampledSpectrum; 2] {
        let mut sum = [SampledSpectrum::ZERO; 2];
        for (k, share) in state.shares().into_iter().enumerate().filter(|(_, share)| *share > 0.0) {
            let of = self.tissue(k, state.pigment, lambda).albedo(wo);
            sum = [sum[0] + of[0] * share, sum[1] + of[1] * share];
        }
        sum
    }

    /// What the petal is made of at texture coordinates, on a grown petal or on another shape; its pigments' factors are c.
    pub fn state(&self, uv: Vec2, petal: Option<&PetalMap>) -> TissueState {
        let v = uv.y.clamp(0.0, 1.0);
        let GradientDescription { claw, rim } = self.gradient;
        let gradient = claw as f32 + (rim - claw) as f32 * v * v * (3.0 - 2.0 * v);
        let factor = gradient * self.texture.as_ref().map_or(1.0, |t| t.at(uv));
        let state = self.pattern.as_ref().map_or(TissueState::SOUND, |pattern| pattern.state(uv, petal));
        TissueState { pigment: state.pigment.times(factor), ..state }
    }

    /// Smallest and largest factor anywhere, of the upper and of the lower epidermis.
    pub fn pigment_ranges(&self) -> [(f32, f32); 2] {
        let GradientDescription { claw, rim } = self.gradient;
        let (low, high) = (claw.min(rim) as f32, claw.max(rim) as f32);
        let texture = |pick: fn(f32, f32) -> f32| match &self.texture {
            Some(t) => t.values.iter().copied().reduce(pick).unwrap_or(1.0),
            None => 1.0,
        };
        let (low, high) = (low * texture(f32::min), high * texture(f32::max));
        let pattern = self.pattern.as_ref().map_or([(1.0, 1.0); 2], Pattern::ranges);
        pattern.map(|(least, most)| (low * least, high * most))
    }

    /// The pattern, which needs to know grown petals.
    pub fn pattern(&self) -> Option<&Pattern> {
        self.pattern.as_ref()
    }

    /// The BSDF where the pigment's factor is one.
    pub fn bsdf(&self) -> &TabulatedBsdf {
        &self.bsdf
    }
}

/// Factors on the pigments of the four regions.
fn scales(pigment: PigmentFactors) -> [f32; REGIONS] {
    let mut scale = [1.0; REGIONS];
    scale[0] = pigment.adaxial;
    scale[REGIONS - 1] = pigment.abaxial;
    scale
}

/// A grey picture.
#[derive(Clone, Debug)]
struct Texture {
    width: usize,
    height: usize,
    /// Row by row from the top.
    values: Vec<f32>,
}

impl Texture {
    fn read(bytes: &[u8]) -> Result<Self> {
        let picture = io::image::read(bytes, io::image::MAX_PIXELS)?;
        let values: Vec<f32> = picture.rgb.iter().map(|rgb| luminance(*rgb)).collect();
        if let Some(v) = values.iter().find(|v| !(**v >= 0.0 && **v <= 1e3)) {
            return Err(Error::invalid("texture", format!("a pixel of {v}; factors lie within 0 to 1000")));
        }
        if values.is_empty() {
            return Err(Error::invalid("texture", "the picture has no pixels"));
        }
        Ok(Self { width: picture.width, height: picture.height, values })
    }

    fn at(&self, uv: Vec2) -> f32 {
        let along = |t: f32, n: usize| {
            let x = (t * n as f32 - 0.5).clamp(0.0, (n - 1) as f32);
            let low = x as usize;
            (low, (low + 1).min(n - 1), x - low as f32)
        };
        let (x0, x1, fx) = along(uv.x, self.width);
        let (y0, y1, fy) = along(1.0 - uv.y, self.height);
        let at = |x: usize, y: usize| self.values[y * self.width + x];
        let row = |y: usize| at(x0, y) + (at(x1, y) - at(x0, y)) * fx;
        row(y0) + (row(y1) - row(y0)) * fy
    }
}

/// What the walks of a measurement depend on, in the form of a petal file.
#[derive(Serialize)]
struct Shape<'a> {
    cells: &'a CellDescription,
    tissue: &'a TissueDescription,
}

/// The tissue without its pigments, which no walk depends on.
fn colourless(tissue: &TissueDescription) -> TissueDescription {
    let mut tissue = tissue.clone();
    for pigments in [&mut tissue.adaxial, &mut tissue.abaxial].into_iter().flatten().map(|e| &mut e.pigments)
    {
        *pigments = Pigments::default();
    }
    for pigments in [&mut tissue.palisade, &mut tissue.spongy].into_iter().flatten().map(|s| &mut s.pigments)
    {
        *pigments = Pigments::default();
    }
    tissue
}

/// The tissue with its mesophyll `factor` times as thick, of the same stuff.
fn in_thickness(tissue: &TissueDescription, factor: f64) -> TissueDescription {
    let mut tissue = tissue.clone();
    for slab in [&mut tissue.palisade, &mut tissue.spongy].into_iter().flatten() {
        slab.thickness_um *= factor;
        slab.pigments = slab.pigments.in_thickness(factor);
    }
    tissue
}

/// The tissue dead: brown all through, with what is left of its own pigments.
fn dead(tissue: &Tissue, withered: &WitheredDescription) -> Tissue {
    let mut tissue = tissue.clone();
    let all: f64 = tissue.depth_um.iter().sum();
    for (pigments, depth) in tissue.pigments.iter_mut().zip(tissue.depth_um) {
        *pigments = pigments.scaled(withered.pigment);
        pigments.brown += withered.brown * depth / all;
    }
    tissue
}

/// The first table in which two shapes differ.
fn difference(
    (cells, tissue): (&CellDescription, &TissueDescription),
    (other_cells, other): (&CellDescription, &TissueDescription),
) -> Option<&'static str> {
    let (tissue, other) = (colourless(tissue), colourless(other));
    [
        ("cells", cells == other_cells),
        ("tissue.adaxial", tissue.adaxial == other.adaxial),
        ("tissue.palisade", tissue.palisade == other.palisade),
        ("tissue.spongy", tissue.spongy == other.spongy),
        ("tissue.abaxial", tissue.abaxial == other.abaxial),
    ]
    .into_iter()
    .find_map(|(name, same)| (!same).then_some(name))
}

impl PetalDescription {
    /// Is the petal shaded from the tables of a tissue?
    pub fn is_tabulated(&self) -> bool {
        self.tissue.is_some() || self.optics.is_some()
    }

    /// Checks and builds the petal, whichever way it is shaded; a tissue is measured, or its optics come from `assets`.
    /// `at` as in [`PetalDescription::compile`].
    pub fn build(&self, at: &str, assets: &dyn Assets) -> Result<Petal> {
        self.validate_tabulated(at)?;
        if !self.is_tabulated() {
            return self.compile(at, assets).map(Petal::Cells);
        }
        let root = |name: &str| if at.is_empty() { Key::new(name) } else { Key::new(at).at(name) };
        let texture = match &self.texture {
            None => None,
            Some(file) => {
                let key = root("texture");
                Some(key.says(assets.read(file).and_then(|bytes| Texture::read(&bytes)))?)
            }
        };
        let pattern = self.pattern.as_ref().map(|p| Pattern::new(p, &root("pattern"))).transpose()?;
        let key = root(if self.optics.is_some() { "optics" } else { "tissue" });
        let of = |factor: f64| {
            let (optics, tissue) = self.optics(at, factor, assets)?;
            Ok::<_, Error>((key.says(TabulatedBsdf::of_tissue(&optics, &tissue))?, optics, tissue))
        };
        let thicknesses = pattern.as_ref().and_then(Pattern::thicknesses);
        let (bsdf, optics, tissue) = of(thicknesses.map_or(1.0, |t| t.1))?;
        let thin = thicknesses.map(|t| of(t.0)).transpose()?.map(|t| t.0);
        let withered = match pattern.as_ref().and_then(Pattern::withered) {
            Some(withered) => Some(key.says(TabulatedBsdf::of_tissue(&optics, &dead(&tissue, withered)))?),
            None => None,
        };
        Ok(Petal::Tabulated(TabulatedPetal {
            bsdf,
            thin,
            withered,
            gradient: self.gradient.unwrap_or_default(),
            pattern,
            texture,
        }))
    }

    /// Checks what only tabulated petals have, short of reading and measuring.
    pub fn validate_tabulated(&self, at: &str) -> Result<()> {
        let root = |name: &str| if at.is_empty() { Key::new(name) } else { Key::new(at).at(name) };
        let given = [
            ("walks", self.walks.is_some()),
            ("gradient", self.gradient.is_some()),
            ("pattern", self.pattern.is_some()),
            ("texture", self.texture.is_some()),
        ];
        if let Some((name, _)) = given.iter().find(|(_, given)| *given && !self.is_tabulated()) {
            return Err(root(name).invalid("only a petal with a `tissue` or `optics` has it"));
        }
        if let Some(walks) = self.walks {
            root("walks").within(walks, 10_000..=1_000_000_000, "within 1e4 to 1e9")?;
        }
        if let Some(GradientDescription { claw, rim }) = self.gradient {
            for (name, value) in [("claw", claw), ("rim", rim)] {
                root("gradient").at(name).within(value, 0.0..=100.0, "within 0 to 100")?;
            }
        }
        if let Some(pattern) = &self.pattern {
            let key = root("pattern");
            let thickness = Pattern::new(pattern, &key)?.thicknesses();
            if thickness.is_some() && (self.optics.is_some() || self.tissue.is_none()) {
                return Err(key.at("thickness").invalid(
                    "needs a `tissue` to measure at two thicknesses; `optics` hold one thickness only",
                ));
            }
        }
        self.build_tissue(at).map(|_| ())
    }

    /// The petal measured with its mesophyll `thickness` times as thick, and the tissue that colours it.
    fn optics(&self, at: &str, thickness: f64, assets: &dyn Assets) -> Result<(Arc<PetalOptics>, Tissue)> {
        let root = |name: &str| if at.is_empty() { Key::new(name) } else { Key::new(at).at(name) };
        let petal = Self { tissue: self.tissue.as_ref().map(|t| in_thickness(t, thickness)), ..self.clone() };
        let own = match (&petal.tissue, petal.build_tissue(at)?) {
            (Some(description), Some(tissue)) => Some((petal.grown_cells(at)?, description, tissue)),
            _ => None,
        };
        if let Some(file) = &self.optics {
            let key = root("optics");
            let optics = key.says(assets.read(file).and_then(|bytes| io::petal_optics::read(&bytes)))?;
            let (cells, description) = key.says(measured_tissue(&optics.description))?;
            let tissue = match own {
                None => key.says(Tissue::new(&description, &cells, "tissue"))?,
                Some((own_cells, own, tissue)) => {
                    if let Some(name) = difference((&own_cells, own), (&cells, &description)) {
                        let what = format!(
                            "{file} was measured on another petal: `{name}` differs; leave `optics` out to measure anew"
                        );
                        return Err(key.invalid(what));
                    }
                    tissue
                }
            };
            return Ok((Arc::new(optics), tissue));
        }
        let key = root("tissue");
        let (cells, description, tissue) = own.ok_or_else(|| key.invalid("is missing"))?;
        let shape = Shape { cells: &cells, tissue: &colourless(description) };
        let description =
            toml::to_string(&shape).map_err(|e| key.invalid(format!("cannot be written: {e}")))?;
        let mut instrument = WhiteMonteCarlo::default();
        instrument.walks = self.walks.unwrap_or(instrument.walks);
        let name = format!("{} {instrument:?}\n{description}", env!("CARGO_PKG_VERSION"));
        let shared = Arc::new(tissue);
        let optics = assets.optics(&name, &|progress| {
            let walk = CellWalk::new(shared.clone());
            let optics = instrument.measure(&walk, shared.depth_um, progress)?;
            Ok(PetalOptics { description: description.clone(), ..optics })
        });
        Ok((key.says(optics)?, Arc::unwrap_or_clone(shared)))
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;
    use crate::bsdf::Bsdf;
    use crate::film::ToneMap;
    use crate::io::png;
    use crate::scene::{MeasureOptics, MemoryAssets, load};
    use crate::validate::sheet;

    fn described(text: &str) -> PetalDescription {
        load(text, "petal.toml", &[]).unwrap().description
    }

    fn files() -> MemoryAssets {
        let mut assets = MemoryAssets::default();
        assets.files.insert("sheet.optics".into(), io::petal_optics::write(&sheet(6, 4)).unwrap());
        // Black above, white below.
        let rows = [[0.0; 3], [1.0; 3]];
        let png = png::write((1, 2), &rows, ToneMap::Linear, 0.0, png::Depth::Sixteen).unwrap();
        assets.files.insert("spots.png".into(), png);
        assets
    }

    fn tabulated(text: &str) -> TabulatedPetal {
        match described(text).build("petal", &files()).unwrap() {
            Petal::Tabulated(petal) => petal,
            Petal::Cells(_) => panic!("tables were given"),
        }
    }

    #[test]
    fn pigment_follows_gradient_and_texture() {
        let lambda = SampledWavelengths::given([500.0, 520.0, 530.0, 540.0, 550.0, 560.0, 580.0, 700.0]);
        let (wo, wi) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.28, 0.96));
        let holds = |petal: &TabulatedPetal, uv: Vec2, epidermes: f32| {
            let found = petal.at(petal.state(uv, None).pigment, &lambda).eval(wo, wi, &lambda);
            let wanted = petal.bsdf().at([epidermes, 1.0, 1.0, epidermes], &lambda).eval(wo, wi, &lambda);
            for lane in 0..8 {
                assert!(
                    (found[lane] / wanted[lane] - 1.0).abs() < 2e-3,
                    "{uv}: {} {}",
                    found[lane],
                    wanted[lane]
                );
            }
        };
        let plain = tabulated("optics = \"sheet.optics\"");
        holds(&plain, Vec2::new(0.3, 0.7), 1.0);
        let graded = tabulated("optics = \"sheet.optics\"\ngradient = { claw = 0.0, rim = 2.0 }");
        for (v, scale) in [(0.0, 0.0), (0.25, 0.3125), (0.5, 1.0), (1.0, 2.0)] {
            holds(&graded, Vec2::new(0.4, v), scale);
        }
        let green = |petal: &TabulatedPetal, v: f32| {
            petal.at(petal.state(Vec2::new(0.5, v), None).pigment, &lambda).albedo(wo)[0][3]
        };
        assert!(green(&graded, 0.0) > 1.5 * green(&graded, 1.0));
        let text = "optics = \"sheet.optics\"\ntexture = \"spots.png\"\ngradient = { rim = 3.0 }";
        let spotted = tabulated(text);
        for (v, scale) in [(0.0, 1.0), (0.1, 1.056), (0.5, 1.0), (0.9, 0.0), (1.0, 0.0)] {
            holds(&spotted, Vec2::new(0.5, v), scale);
        }
    }

    #[test]
    fn optics_must_be_of_the_same_shape() {
        let build = |text: &str| described(text).build("petal", &files());
        let red = "optics = \"sheet.optics\"\n[tissue.adaxial]\npigments = { anthocyanin_ug_per_cm2 = 90.0 }\n[tissue.abaxial]\n";
        assert!(build(red).is_ok());
        for (text, what) in [
            (format!("{red}depth_um = 30.0\n"), "`tissue.abaxial` differs"),
            (red.replace("[tissue.abaxial]\n", ""), "`tissue.abaxial` differs"),
            (format!("{red}[cells]\nheight_um = 5.0\n"), "`cells` differs"),
            (red.replace("sheet.optics", "other.optics"), "other.optics"),
            (red.replace("sheet.optics", "spots.png"), "not a measured petal"),
        ] {
            let e = build(&text).unwrap_err().to_string();
            assert!(e.starts_with("petal.optics: ") && e.contains(what), "{e}");
        }
    }

    #[test]
    fn wrong_keys_are_named() {
        let optics = "optics = \"sheet.optics\"\n";
        for (text, start) in [
            ("walks = 20000".to_owned(), "petal.walks: only a petal with"),
            ("texture = \"spots.png\"".to_owned(), "petal.texture: only a petal with"),
            ("gradient = {}".to_owned(), "petal.gradient: only a petal with"),
            (format!("{optics}walks = 10"), "petal.walks: 10 is not within"),
            (format!("{optics}gradient = {{ claw = -1.0 }}"), "petal.gradient.claw: -1 is not within"),
            (format!("{optics}gradient = {{ rim = nan }}"), "petal.gradient.rim: NaN is not within"),
            ("[pattern]".to_owned(), "petal.pattern: only a petal with"),
            (
                format!("{optics}pattern.claw_spot.extent = 1.5"),
                "petal.pattern.claw_spot.extent: 1.5 is not within 0.01",
            ),
            (format!("{optics}texture = \"none.png\""), "petal.texture: "),
            (format!("{optics}texture = \"sheet.optics\""), "petal.texture: "),
            (format!("{optics}pattern.thickness.margin = 0.5"), "petal.pattern.thickness: needs a `tissue`"),
            ("[tissue]".to_owned(), "petal.tissue: has no layer"),
        ] {
            let e = described(&text).build("petal", &files()).unwrap_err().to_string();
            assert!(e.starts_with(start), "{e}");
        }
    }

    /// Keeps nothing and remembers what it was asked for.
    struct Asked(RefCell<Vec<String>>);

    impl Assets for Asked {
        fn read(&self, path: &str) -> Result<Vec<u8>> {
            MemoryAssets::default().read(path)
        }

        fn optics(&self, key: &str, measure: MeasureOptics) -> Result<Arc<PetalOptics>> {
            self.0.borrow_mut().push(key.to_owned());
            measure(&|_, _| std::ops::ControlFlow::Continue(())).map(Arc::new)
        }
    }

    #[test]
    fn a_tissue_is_measured_without_its_pigments() {
        let asked = Asked(RefCell::default());
        let build = |ug: f64, depth: f64| {
            let text = format!(
                "walks = 10000\n[tissue.adaxial]\ndepth_um = {depth:?}\npigments = {{ anthocyanin_ug_per_cm2 = {ug:?} }}\n[tissue.spongy]\nthickness_um = 50.0\nscattering_per_mm = 100.0\nanisotropy = 0.5\n"
            );
            match described(&text).build("", &asked).unwrap() {
                Petal::Tabulated(petal) => petal,
                Petal::Cells(_) => panic!("a tissue was given"),
            }
        };
        let (pale, red, thick) = (build(1.0, 20.0), build(50.0, 20.0), build(1.0, 30.0));
        let keys = asked.0.borrow();
        assert!(keys[0] == keys[1] && keys[0] != keys[2], "{keys:?}");
        let lambda = SampledWavelengths::given([540.0; 8]);
        let green = |p: &TabulatedPetal| p.at(PigmentFactors::ONE, &lambda).albedo(Vec3::Z).map(|a| a[0]);
        assert!(green(&pale)[0] > 1.3 * green(&red)[0] && green(&pale)[1] > 1.3 * green(&red)[1]);
        assert!((green(&pale)[0] / green(&thick)[0] - 1.0).abs() < 0.2);
    }
}
