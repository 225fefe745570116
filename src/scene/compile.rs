//! A description to a [`Scene`]: everything is checked, grown, read and placed.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::assets::{Assets, HashedAssets};
use super::camera::Camera;
use super::description::{
    FilmDescription, PetalDescription, RenderDescription, RoseMaterials, SceneDescription, ShapeDescription,
};
use super::emitter::{Emitter, Lights};
use super::hash::Fnv128;
use super::key::Key;
use super::locate::nearest;
use super::material::Material;
use super::pattern::Pattern;
use super::shape::{self, Shape};
use super::tabulated::Petal;
use super::{description, lens, light};
use crate::film::View;
use crate::film::view::white_balance;
use crate::flower::OrganKind;
use crate::geometry::bvh::Bvh;
use crate::{Error, Result};

/// Temperature of D65, K, which is white where no white balance is asked for.
const D65_K: f64 = 6504.0;

/// All that a picture needs, checked and ready.
#[derive(Debug)]
pub struct Scene {
    /// The picture.
    pub film: FilmDescription,
    /// How it is computed.
    pub render: RenderDescription,
    /// The petal of [`Material::Petal`].
    pub petal: PetalDescription,
    /// Where the picture is taken from.
    pub camera: Camera,
    /// How its light is shown.
    pub view: View,
    /// Every mesh; a hit's `shape` is an index into it.
    pub shapes: Vec<Shape>,
    /// Every material; a shape's `material` is an index into it.
    pub materials: Vec<Material>,
    /// Key of every material (`materials.NAME`; the light's for the body of an area light).
    pub material_keys: Vec<String>,
    /// Every light; a shape's `emitter` is an index into them.
    pub lights: Lights,
    /// Acceleration structure over all shapes, in their order.
    pub bvh: Bvh,
    /// Smallest and largest corner of all shapes, mm.
    pub bounds: (Vec3, Vec3),
    /// Names what is rendered: equal for equal descriptions and files, whatever `spp` and `seed` are.
    pub scene_hash: u128,
}

/// Checks a description and makes it a scene. Errors name the dotted key that is wrong;
/// [`Source::locate`](super::Source::locate) finds its line.
pub fn compile(description: &SceneDescription, assets: &dyn Assets) -> Result<Scene> {
    let assets = HashedAssets::new(assets, hash_of(description)?);
    check_render(&description.render)?;
    check_film(&description.film)?;
    let petal = Arc::new(description.petal.build("petal", &assets)?);
    let film_px = [description.film.width, description.film.height];
    let camera = Camera::new(&lens::compile(&description.camera, film_px)?);
    let view = view(&description.film, &camera, description.render.seed)?;

    let mut compiler = Compiler {
        petal,
        materials: Vec::new(),
        material_keys: Vec::new(),
        ids: BTreeMap::new(),
        shapes: Vec::new(),
        emitters: Vec::new(),
    };
    for (name, d) in &description.materials {
        let key = Key::new("materials").at(name);
        let material = Material::compile(d, &compiler.petal, &key, &assets)?;
        compiler.material_keys.push(key.to_string());
        compiler.ids.insert(name.clone(), compiler.materials.len() as u32);
        compiler.materials.push(material);
    }
    for (name, d) in &description.shapes {
        compiler.shape(d, &Key::new("shapes").at(name), &assets)?;
    }
    if compiler.shapes.is_empty() {
        return Err(Error::invalid("shapes", "the scene has no shape; add a [shapes.NAME] table"));
    }
    let lit = bounds(compiler.shapes.iter().filter(|s| s.emitter.is_none()));
    for (name, d) in &description.lights {
        compiler.light(d, &Key::new("lights").at(name), &assets)?;
    }
    if compiler.emitters.is_empty() {
        return Err(Error::invalid(
            "lights",
            "the scene has no light; add a [lights.NAME] table, or `emission` to a shape",
        ));
    }
    let bounds = bounds(compiler.shapes.iter());
    let lit = if lit.0.is_finite() { lit } else { bounds };
    let lights = Lights::new(compiler.emitters, (lit.0 + lit.1) / 2.0, (lit.1 - lit.0).length() / 2.0);
    let bvh = Bvh::build(compiler.shapes.iter().map(|s| &s.mesh));
    Ok(Scene {
        film: description.film.clone(),
        render: description.render.clone(),
        petal: description.petal.clone(),
        camera,
        view,
        shapes: compiler.shapes,
        materials: compiler.materials,
        material_keys: compiler.material_keys,
        lights,
        bvh,
        bounds,
        scene_hash: assets.finish(),
    })
}

struct Compiler {
    petal: Arc<Petal>,
    materials: Vec<Material>,
    material_keys: Vec<String>,
    ids: BTreeMap<String, u32>,
    shapes: Vec<Shape>,
    emitters: Vec<Emitter>,
}

impl Compiler {
    fn shape(&mut self, d: &ShapeDescription, key: &Key, assets: &dyn Assets) -> Result<()> {
        let first = self.shapes.len();
        let mut patterned = Vec::new();
        for part in shape::parts(d, key, assets)? {
            let material = match (d.organs(), part.organ) {
                (Some(names), Some(kind)) => self.organ_material(names, kind, key, assets)?,
                _ => {
                    let name = d.surface().map_or("", |(material, _)| material);
                    self.material(name, &key.at("material"))?
                }
            };
            let emitter = match d.surface() {
                Some((_, Some(emission))) => {
                    self.emitters.push(light::of_shape(emission, &part.mesh, &key.at("emission"), assets)?);
                    Some(self.emitters.len() as u32 - 1)
                }
                _ => None,
            };
            let organs = self.shapes.iter().map(|s| s.organ_id).max().unwrap_or(0);
            let petals = self.shapes.iter().map(|s| s.petal_id).max().unwrap_or(0);
            self.shapes.push(Shape {
                key: key.to_string(),
                mesh: part.mesh,
                material,
                organ: part.organ,
                organ_id: if part.organ.is_some() { organs + 1 } else { 0 },
                petal_id: if part.organ == Some(OrganKind::Petal) { petals + 1 } else { 0 },
                emitter,
                uv_scale_mm: part.uv_scale_mm,
                petal: None,
            });
            patterned.push(part.traits.filter(|_| self.pattern(material).is_some()));
        }
        let maps: Vec<_> = patterned
            .par_iter()
            .zip(&self.shapes[first..])
            .map(|(traits, shape)| {
                let (traits, pattern) = (traits.as_ref()?, self.pattern(shape.material)?);
                Some(Arc::new(pattern.map(traits)))
            })
            .collect();
        for (shape, map) in self.shapes[first..].iter_mut().zip(maps) {
            shape.petal = map;
        }
        Ok(())
    }

    /// The pattern of a material's pigment.
    fn pattern(&self, material: u32) -> Option<&Pattern> {
        match &self.materials[material as usize] {
            Material::Petal(petal) => match &**petal {
                Petal::Tabulated(petal) => petal.pattern(),
                Petal::Cells(_) => None,
            },
            _ => None,
        }
    }

    fn light(&mut self, d: &description::LightDescription, key: &Key, assets: &dyn Assets) -> Result<()> {
        let compiled = light::compile(d, key, assets)?;
        if let Some(mesh) = compiled.mesh {
            self.materials.push(Material::black()?);
            self.material_keys.push(key.to_string());
            self.shapes.push(Shape {
                key: key.to_string(),
                mesh,
                material: self.materials.len() as u32 - 1,
                organ: None,
                organ_id: 0,
                petal_id: 0,
                emitter: Some(self.emitters.len() as u32),
                uv_scale_mm: glam::Vec2::ZERO,
                petal: None,
            });
        }
        self.emitters.extend(compiled.emitters);
        Ok(())
    }

    fn organ_material(
        &mut self,
        names: &RoseMaterials,
        kind: OrganKind,
        key: &Key,
        assets: &dyn Assets,
    ) -> Result<u32> {
        let (name, organ) = match kind {
            OrganKind::Petal => (&names.petal, "petal"),
            OrganKind::Sepal => (&names.sepal, "sepal"),
            OrganKind::Receptacle => (&names.receptacle, "receptacle"),
            OrganKind::Stem => (&names.stem, "stem"),
            OrganKind::Leaf => (&names.leaf, "leaf"),
            OrganKind::Prickle => (&names.prickle, "prickle"),
            OrganKind::Filament => (&names.stamen, "stamen"),
            OrganKind::Anther => (&names.anther, "anther"),
            OrganKind::Style => (&names.style, "style"),
        };
        if let (None, Some(d)) = (self.ids.get(name), RoseMaterials::built_in(name)) {
            let key = Key::new("materials").at(name);
            self.ids.insert(name.clone(), self.materials.len() as u32);
            self.materials.push(Material::compile(&d, &self.petal, &key, assets)?);
            self.material_keys.push(key.to_string());
        }
        self.material(name, &key.at("materials").at(organ))
    }

    fn material(&self, name: &str, key: &Key) -> Result<u32> {
        self.ids.get(name).copied().ok_or_else(|| {
            let known: Vec<&str> = self.ids.keys().map(String::as_str).collect();
            key.invalid(match nearest(name, known.iter().copied()) {
                Some(n) => format!("no material is called `{name}`; did you mean `{n}`?"),
                None if known.is_empty() => {
                    format!("no material is called `{name}`; add a [materials.{name}] table")
                }
                None => format!("no material is called `{name}`; there are {}", known.join(", ")),
            })
        })
    }
}

fn check_film(film: &FilmDescription) -> Result<()> {
    let key = Key::new("film");
    key.at("width").within(film.width, 1..=32768, "within 1 to 32768 pixels")?;
    key.at("height").within(film.height, 1..=32768, "within 1 to 32768 pixels")?;
    if let Some(radius) = film.filter_radius_px {
        key.at("filter_radius_px").within(radius, 0.1..=16.0, "within 0.1 to 16 pixels")?;
    }
    Ok(())
}

fn view(film: &FilmDescription, camera: &Camera, seed: u64) -> Result<View> {
    let key = Key::new("film");
    let exposure = key.at("exposure_ev").within(film.exposure_ev, -50.0..=50.0, "within -50 to 50 stops")?;
    let tint = key.at("tint").within(film.tint, -150.0..=150.0, "within -150 to 150")?;
    let vignetting = key.at("vignetting").within(film.vignetting, 0.0..=20.0, "within 0 to 20")?;
    let grain = key.at("grain").within(film.grain, 0.0..=1.0, "within 0 to 1")?;
    let balance = match film.white_balance_k {
        None if tint == 0.0 => Mat3::IDENTITY,
        None => key.at("tint").name(white_balance(D65_K, tint))?,
        Some(k) => {
            key.at("white_balance_k").name(white_balance(k, 0.0))?;
            key.at("tint").name(white_balance(k, tint))?
        }
    };
    Ok(View {
        exposure_ev: exposure as f32,
        tone_map: film.tone_map,
        balance,
        vignetting: vignetting as f32,
        tan_half_fov: camera.tan_half_fov(),
        grain: grain as f32,
        seed,
    })
}

fn check_render(render: &RenderDescription) -> Result<()> {
    let key = Key::new("render");
    key.at("spp").within(render.spp, 1.., "at least 1")?;
    key.at("max_depth").within(render.max_depth, 1..=100_000, "within 1 to 100000")?;
    let (key, r) = (key.at("radiosity"), &render.radiosity);
    for (name, value) in [("elements", r.elements), ("rays", r.rays), ("light_samples", r.light_samples)] {
        key.at(name).within(value, 1..=50_000_000, "within 1 to 5e7")?;
    }
    key.at("wavelengths").within(r.wavelengths, 2..=401, "within 2 to 401")?;
    key.at("residual").within(r.residual, 1e-12..=0.999, "within 1e-12 to 0.999")?;
    key.at("near").within(r.near, 0.0..=1e6, "within 0 to 1e6")?;
    Ok(())
}

fn bounds<'a>(shapes: impl Iterator<Item = &'a Shape>) -> (Vec3, Vec3) {
    shapes
        .map(|s| s.mesh.bounds())
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), (l, h)| (low.min(l), high.max(h)))
}

/// Hash of the description's canonical text: keys in order, defaults written out.
fn hash_of(description: &SceneDescription) -> Result<Fnv128> {
    let mut named = description.clone();
    named.schema = None;
    named.render.spp = 0;
    named.render.seed = 0;
    let text = serde_json::to_string(&named).map_err(|e| Error::invalid("scene", e.to_string()))?;
    let mut hash = Fnv128::new();
    hash.write(text.as_bytes());
    Ok(hash)
}
