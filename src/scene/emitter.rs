//! Lights: what they send, and choosing a direction towards one of them.
//!
//! Model: one light is picked with a fixed probability, then a direction (or a point) on it:
//! `pdf = p_pick * p_light(wi)`, per solid angle seen from the lit point. Lights at infinity overlap each
//! other, so their radiances and densities are summed: whichever of them was picked, the sample carries
//! all of their light in that direction and the density with which any of them would have chosen it.
//!
//! | light    | sampled                          | density                       | contribution      |
//! |----------|----------------------------------|-------------------------------|-------------------|
//! | constant | uniform sphere                   | 1 / 4 pi                      | L                 |
//! | image    | pixel by its light               | see [`Environment`]           | L(w)              |
//! | sky      | pixel of an image of it          | see [`Sky`]                   | L(w)              |
//! | distant  | uniform cone of half angle a > 0 | 1 / (2 pi (1 - cos a))        | E / (pi sin^2 a)  |
//! | distant  | one direction, a = 0             | delta                         | E                 |
//! | point    | one direction                    | delta                         | I / d^2           |
//! | area     | uniform on its triangles         | d^2 / (A cos)                 | L                 |
//!
//! Picking: in proportion to the irradiance that a light would give in the middle of what does not glow,
//! unoccluded, with a tenth spread evenly, so that no light is forgotten. Guarded by
//! `directions_follow_the_density`, `constant_light_gives_pi_l`, `distant_irradiance_is_its_key`,
//! `disc_light_has_its_form_factor`, `mixture_is_unbiased`.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::environment::{Environment, search};
use super::sky::Sky;
use crate::geometry::Mesh;
use crate::math::{Frame, warp};
use crate::spectrum::illuminant::d65;
use crate::spectrum::{RgbBasis, SampledSpectrum, SampledWavelengths, Spectrum};

/// One light.
#[derive(Clone, Debug)]
pub enum Emitter {
    /// The same radiance from every direction.
    Constant {
        /// Radiance.
        radiance: Spectrum,
    },
    /// An image of the surroundings.
    Image {
        /// The image.
        image: Box<Environment>,
        /// Factor on its values.
        scale: f32,
    },
    /// A clear sky and the ground, without the sun's disc.
    Sky(Box<Sky>),
    /// A cone of light, or parallel light.
    Distant {
        /// `frame.n` points to the light.
        frame: Frame,
        /// 1 - cos of the cone's half angle; 0 is parallel light.
        one_minus_cos: f32,
        /// Radiance, or irradiance where the light is parallel.
        value: Spectrum,
    },
    /// A light without size.
    Point {
        /// Place, mm.
        position: Vec3,
        /// Radiant intensity, radiance times mm^2.
        intensity: Spectrum,
    },
    /// A glowing surface.
    Area(AreaEmitter),
}

/// A glowing surface.
#[derive(Clone, Debug)]
pub struct AreaEmitter {
    triangles: Vec<[Vec3; 3]>,
    cumulative: Vec<f32>,
    area_mm2: f32,
    two_sided: bool,
    radiance: Spectrum,
}

impl AreaEmitter {
    /// All of a mesh. It glows on the side of its normals (without any, of its counter-clockwise faces), or on both.
    pub fn new(mesh: &Mesh, radiance: Spectrum, two_sided: bool) -> Self {
        let areas = (0..mesh.triangles.len()).map(|f| f64::from(mesh.face_area(f)));
        let total: f64 = areas.clone().sum();
        let mut sum = 0.0;
        let mut cumulative = vec![0.0];
        cumulative.extend(areas.map(|a| {
            sum += a;
            (sum / total) as f32
        }));
        if let Some(last) = cumulative.last_mut() {
            *last = 1.0;
        }
        let triangles = (0..mesh.triangles.len())
            .map(|f| {
                let [a, b, c] = mesh.corners(f);
                let normal = |i: u32| mesh.normals.get(i as usize).copied().unwrap_or(Vec3::ZERO);
                let outwards: Vec3 = mesh.triangles[f].into_iter().map(normal).sum();
                // A file's winding may go against its normals; a ray that hits the light decides by these too.
                if (b - a).cross(c - a).dot(outwards) < 0.0 { [a, c, b] } else { [a, b, c] }
            })
            .collect();
        Self { triangles, cumulative, area_mm2: total as f32, two_sided, radiance }
    }

    /// Radiance of a side that glows.
    pub(super) fn radiance(&self) -> &Spectrum {
        &self.radiance
    }

    /// Area, mm2.
    pub(super) fn area_mm2(&self) -> f32 {
        self.area_mm2
    }

    /// How many sides glow.
    pub fn sides(&self) -> u32 {
        if self.two_sided { 2 } else { 1 }
    }

    /// Uniform point with its geometric normal.
    pub(super) fn sample(&self, u: Vec2) -> (Vec3, Vec3) {
        let (face, x) = search(&self.cumulative, u.x);
        let [a, b, c] = self.triangles[face];
        let w = warp::square_to_triangle(Vec2::new(x, u.y));
        (a * w.x + b * w.y + c * w.z, (b - a).cross(c - a).normalize_or_zero())
    }

    /// Density, per solid angle seen from `from`, of the point `on` with normal `ng`.
    fn pdf(&self, from: Vec3, on: Vec3, ng: Vec3) -> f32 {
        let d = on - from;
        let cos = (d.dot(ng) / d.length()).abs();
        if cos > 0.0 { d.length_squared() / (cos * self.area_mm2) } else { 0.0 }
    }

    /// Does the surface with normal `ng` glow towards `wo`?
    fn glows(&self, ng: Vec3, wo: Vec3) -> bool {
        self.two_sided || ng.dot(wo) > 0.0
    }
}

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction to the light.
    pub wi: Vec3,
    /// Distance to the light, mm; infinite for lights at infinity. A shadow ray ends just before it.
    pub distance_mm: f32,
    /// Radiance that arrives; for a delta light the irradiance on a surface that faces it. Either way the
    /// contribution is `f |cos| radiance / pdf_per_sr`.
    pub radiance: SampledSpectrum,
    /// Density, 1/sr; for a delta light the probability of picking it.
    pub pdf_per_sr: f32,
    /// True where no other way of sampling can find this direction.
    pub delta: bool,
}

/// A direction towards a light, whatever the wavelengths.
#[derive(Clone, Copy, Debug)]
pub struct LightWay {
    /// As [`LightSample::wi`].
    pub wi: Vec3,
    /// As [`LightSample::distance_mm`].
    pub distance_mm: f32,
    /// Factor on the light's own spectrum: 1, and for a point light 1 / distance^2, 1/mm2.
    pub factor: f32,
    /// As [`LightSample::pdf_per_sr`].
    pub pdf_per_sr: f32,
    /// As [`LightSample::delta`].
    pub delta: bool,
}

/// Scenes with more lights than this draw one of them where the camera looks, too.
pub const MAX_EACH: usize = 8;

/// How the lights are drawn at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drawing {
    /// One light, picked by its estimated irradiance.
    One,
    /// Every light once: for what the camera sees directly.
    Each,
    /// One light, picked with these probabilities; there are at most so many lights.
    Chosen([f32; MAX_EACH]),
}

/// All lights of a scene.
#[derive(Clone, Debug)]
pub struct Lights {
    emitters: Vec<Emitter>,
    cumulative: Vec<f32>,
}

impl Lights {
    /// The lights; `middle` and `radius` bound what they should light.
    pub fn new(emitters: Vec<Emitter>, middle: Vec3, radius: f32) -> Self {
        let estimates: Vec<f64> =
            emitters.iter().map(|e| f64::from(e.irradiance_estimate(middle, radius))).collect();
        let total: f64 = estimates.iter().sum();
        let n = estimates.len() as f64;
        let mut sum = 0.0;
        let mut cumulative = vec![0.0];
        cumulative.extend(estimates.iter().map(|e| {
            sum += if total > 0.0 { 0.9 * e / total + 0.1 / n } else { 1.0 / n };
            sum as f32
        }));
        if let Some(last) = cumulative.last_mut() {
            *last = 1.0;
        }
        Self { emitters, cumulative }
    }

    /// The lights, in order of their ids.
    pub fn emitters(&self) -> &[Emitter] {
        &self.emitters
    }

    /// Probability of picking light `i`.
    pub fn pick_probability(&self, i: usize) -> f32 {
        self.cumulative[i + 1] - self.cumulative[i]
    }

    /// Expected number of times that light `i` is drawn.
    fn share(&self, i: usize, drawing: Drawing) -> f32 {
        match drawing {
            Drawing::One => self.pick_probability(i),
            Drawing::Each => 1.0,
            Drawing::Chosen(p) => p.get(i).copied().unwrap_or(0.0),
        }
    }

    /// Draws a direction from `p` towards a light. `None` where the chosen light sends nothing to `p`.
    pub fn sample(&self, p: Vec3, u_pick: f32, u: Vec2, lambda: &SampledWavelengths) -> Option<LightSample> {
        self.sample_light(self.pick(u_pick)?, Drawing::One, p, u, lambda)
    }

    /// Picks one light; there is none in the dark.
    pub fn pick(&self, u_pick: f32) -> Option<usize> {
        (!self.emitters.is_empty()).then(|| search(&self.cumulative, u_pick).0)
    }

    /// Draws a direction from `p` towards light `i`, which is drawn as `drawing` says.
    pub fn sample_light(
        &self,
        i: usize,
        drawing: Drawing,
        p: Vec3,
        u: Vec2,
        lambda: &SampledWavelengths,
    ) -> Option<LightSample> {
        let way = self.way(i, drawing, p, u)?;
        let radiance = self.arriving(i, &way, lambda);
        let LightWay { wi, distance_mm, pdf_per_sr, delta, .. } = way;
        (!radiance.is_zero()).then_some(LightSample { wi, distance_mm, radiance, pdf_per_sr, delta })
    }

    /// The direction alone, which is the same at all wavelengths.
    pub fn way(&self, i: usize, drawing: Drawing, p: Vec3, u: Vec2) -> Option<LightWay> {
        let pick = self.share(i, drawing);
        let far = |wi: Vec3| LightWay {
            wi,
            distance_mm: f32::INFINITY,
            factor: 1.0,
            pdf_per_sr: self.pdf_environment(wi, drawing),
            delta: false,
        };
        let way = match &self.emitters[i] {
            Emitter::Constant { .. } => far(warp::square_to_sphere(u)),
            Emitter::Image { image, .. } => far(image.sample(u)?.0),
            Emitter::Sky(sky) => far(sky.sample(u)?.0),
            Emitter::Distant { frame, one_minus_cos, .. } if *one_minus_cos == 0.0 => {
                LightWay { pdf_per_sr: pick, delta: true, ..far(frame.n) }
            }
            Emitter::Distant { frame, one_minus_cos, .. } => {
                far(frame.to_world(warp::square_to_cone(u, *one_minus_cos)))
            }
            Emitter::Point { position, .. } => {
                let d = *position - p;
                let distance_mm = d.length();
                let factor = 1.0 / d.length_squared();
                LightWay { wi: d / distance_mm, distance_mm, factor, pdf_per_sr: pick, delta: true }
            }
            Emitter::Area(area) => {
                let (on, ng) = area.sample(u);
                let d = on - p;
                let distance_mm = d.length();
                let wi = d / distance_mm;
                if !area.glows(ng, -wi) {
                    return None;
                }
                let pdf_per_sr = pick * area.pdf(p, on, ng);
                LightWay { wi, distance_mm, factor: 1.0, pdf_per_sr, delta: false }
            }
        };
        (way.pdf_per_sr > 0.0 && way.pdf_per_sr.is_finite()).then_some(way)
    }

    /// What arrives on a way to light `i`: see [`LightSample::radiance`].
    pub fn arriving(&self, i: usize, way: &LightWay, lambda: &SampledWavelengths) -> SampledSpectrum {
        match self.spectrum(i) {
            Some(spectrum) => spectrum.sample(lambda) * way.factor,
            None => self.environment(way.wi, lambda),
        }
    }

    /// The spectrum of light `i`, of which every way brings [`LightWay::factor`] times as much; none where light comes from
    /// infinity in a range of directions, each with its own, where several lights add up.
    pub fn spectrum(&self, i: usize) -> Option<&Spectrum> {
        match &self.emitters[i] {
            Emitter::Distant { one_minus_cos, value, .. } if *one_minus_cos == 0.0 => Some(value),
            Emitter::Point { intensity, .. } => Some(intensity),
            Emitter::Area(area) => Some(&area.radiance),
            _ => None,
        }
    }

    /// Radiance from beyond everything, in the unit direction `w` away from the scene.
    pub fn environment(&self, w: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        let mut sum = SampledSpectrum::ZERO;
        for e in &self.emitters {
            match e {
                Emitter::Constant { radiance } => sum += radiance.sample(lambda),
                Emitter::Image { image, scale } => {
                    let rgb = (image.rgb(w) * *scale).to_array();
                    sum += RgbBasis::get().sample(rgb, lambda) * d65().sample(lambda);
                }
                Emitter::Sky(sky) => sum += sky.radiance(w, lambda),
                Emitter::Distant { frame, one_minus_cos, value } if in_cone(frame, *one_minus_cos, w) => {
                    sum += value.sample(lambda);
                }
                _ => {}
            }
        }
        sum
    }

    /// Density with which [`Lights::sample`] draws the direction `w` to the lights at infinity, 1/sr.
    pub fn pdf_environment(&self, w: Vec3, drawing: Drawing) -> f32 {
        let mut sum = 0.0;
        for (i, e) in self.emitters.iter().enumerate() {
            sum += self.share(i, drawing)
                * match e {
                    Emitter::Constant { .. } => warp::SPHERE_PDF,
                    Emitter::Image { image, .. } => image.pdf(w),
                    Emitter::Sky(sky) => sky.pdf(w),
                    Emitter::Distant { frame, one_minus_cos, .. } if in_cone(frame, *one_minus_cos, w) => {
                        warp::cone_pdf(*one_minus_cos)
                    }
                    _ => 0.0,
                };
        }
        sum
    }

    /// Radiance of the glowing surface `emitter` towards `wo`, where its geometric normal is `ng`.
    pub fn emitted(&self, emitter: u32, ng: Vec3, wo: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        match self.emitters.get(emitter as usize) {
            Some(Emitter::Area(area)) if area.glows(ng, wo) => area.radiance.sample(lambda),
            _ => SampledSpectrum::ZERO,
        }
    }

    /// Density with which [`Lights::sample`] at `from` draws the direction to the point `on` of the glowing
    /// surface `emitter` with geometric normal `ng`, 1/sr.
    pub fn pdf_area(&self, emitter: u32, from: Vec3, on: Vec3, ng: Vec3, drawing: Drawing) -> f32 {
        match self.emitters.get(emitter as usize) {
            Some(Emitter::Area(area)) if area.glows(ng, from - on) => {
                self.share(emitter as usize, drawing) * area.pdf(from, on, ng)
            }
            _ => 0.0,
        }
    }
}

/// Is `w` within the cone around `frame.n`? By the chord, whose square is 2 (1 - cos): it keeps its digits in
/// the sun's narrow cone.
fn in_cone(frame: &Frame, one_minus_cos: f32, w: Vec3) -> bool {
    one_minus_cos > 0.0 && (w - frame.n).length_squared() <= 2.0 * one_minus_cos
}

impl Emitter {
    /// Irradiance around `middle`, unoccluded, within a factor: only for picking.
    fn irradiance_estimate(&self, middle: Vec3, radius: f32) -> f32 {
        match self {
            Emitter::Constant { radiance } => PI * radiance.mean(),
            Emitter::Image { image, scale } => PI * image.mean_luminance() * scale,
            Emitter::Sky(sky) => PI * sky.mean_luminance(),
            Emitter::Distant { one_minus_cos, value, .. } => {
                let projected = PI * one_minus_cos * (2.0 - one_minus_cos);
                value.mean() * if *one_minus_cos > 0.0 { projected } else { 1.0 }
            }
            Emitter::Point { position, intensity } => {
                intensity.mean() / position.distance_squared(middle).max(radius * radius).max(1e-12)
            }
            Emitter::Area(area) => {
                let n = area.triangles.len().max(1) as f32;
                let centre = area.triangles.iter().map(|t| (t[0] + t[1] + t[2]) / 3.0).sum::<Vec3>() / n;
                let d2 = centre.distance_squared(middle).max(radius * radius).max(1e-12);
                // A large near light cannot give more than a hemisphere.
                area.radiance.mean() * (area.area_mm2 / d2).min(PI)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Sampler;
    use crate::scene::shape;
    use glam::UVec2;
    use std::f32::consts::TAU;

    const UP: Vec3 = Vec3::Z;

    fn lambda() -> SampledWavelengths {
        SampledWavelengths::visible(0.5)
    }

    fn constant(radiance: f32) -> Emitter {
        Emitter::Constant { radiance: Spectrum::Constant(radiance) }
    }

    fn cone(towards: Vec3, radius_deg: f32, irradiance: f32) -> Emitter {
        let r = radius_deg.to_radians();
        let one_minus_cos = 2.0 * (r / 2.0).sin().powi(2);
        let value =
            Spectrum::Constant(if r > 0.0 { irradiance / (PI * r.sin().powi(2)) } else { irradiance });
        Emitter::Distant { frame: Frame::from_normal(towards.normalize()), one_minus_cos, value }
    }

    fn image() -> Emitter {
        let pixels = (0..16 * 8).map(|i| [0.1 + (i % 16) as f32, 0.5, (i / 16) as f32 * 0.3]).collect();
        Emitter::Image { image: Box::new(Environment::new(16, 8, pixels, 1.0).unwrap()), scale: 0.5 }
    }

    fn sky() -> Emitter {
        let sun = Vec3::new(0.3, -0.4, 0.6).normalize().as_dvec3();
        let (light, ground) = (Spectrum::Constant(1.0), Spectrum::Constant(0.2));
        Emitter::Sky(Box::new(Sky::new(sun, 3.0, &light, &ground, 10.0).unwrap()))
    }

    fn quad_above(height: f32) -> Emitter {
        // The quad's normal is +z; turned over, it faces down.
        let mesh = shape::place(
            shape::quad(40.0, 20.0),
            |p| Vec3::new(p.x + 15.0, -p.y, height),
            |n| Vec3::new(n.x, -n.y, -n.z),
        );
        Emitter::Area(AreaEmitter::new(&mesh, Spectrum::Constant(2.0), false))
    }

    fn lights(emitters: Vec<Emitter>) -> Lights {
        Lights::new(emitters, Vec3::ZERO, 10.0)
    }

    /// Irradiance on a surface at `p` with normal +z, by sampling the lights `n` times.
    fn irradiance(lights: &Lights, p: Vec3, n: u32) -> f64 {
        let mut sum = 0.0;
        for i in 0..n {
            let mut s = Sampler::new(11, UVec2::ZERO, i);
            if let Some(l) = lights.sample(p, s.next_1d(), s.next_2d(), &lambda()) {
                sum += f64::from(l.radiance[0] * l.wi.dot(UP).max(0.0) / l.pdf_per_sr);
            }
        }
        sum / f64::from(n)
    }

    #[test]
    fn constant_light_gives_pi_l() {
        let e = irradiance(&lights(vec![constant(0.7)]), Vec3::ZERO, 1 << 14);
        assert!((e / (0.7 * std::f64::consts::PI) - 1.0).abs() < 1e-3, "{e}");
    }

    #[test]
    fn distant_irradiance_is_its_key() {
        for radius_deg in [0.0, 0.265, 5.0, 40.0] {
            let facing = irradiance(&lights(vec![cone(UP, radius_deg, 3.0)]), Vec3::ZERO, 1 << 12);
            assert!((facing - 3.0).abs() < 3e-3, "{radius_deg} deg: {facing}");
        }
        let slanted =
            irradiance(&lights(vec![cone(Vec3::new(1.0, 0.0, 1.0), 5.0, 3.0)]), Vec3::ZERO, 1 << 12);
        assert!((slanted - 3.0 / 2f64.sqrt()).abs() < 3e-3, "{slanted}");
    }

    #[test]
    fn a_narrow_cone_is_where_it_is_sampled() {
        let l = lights(vec![cone(Vec3::new(0.3, -0.5, 0.8), 0.265, 1.0)]);
        let mut outside = 0;
        for i in 0..4096 {
            let mut s = Sampler::new(1, UVec2::ZERO, i);
            // A direction drawn on the rim may round to the outside; then it carries no light.
            outside += u32::from(l.sample(Vec3::ZERO, 0.5, s.next_2d(), &lambda()).is_none());
        }
        assert!(outside <= 2, "{outside}");
    }

    #[test]
    fn disc_light_has_its_form_factor() {
        // Disc of radius r, parallel to the surface at height h above it: E = pi L r^2 / (r^2 + h^2).
        let (r, h) = (30.0f64, 25.0f64);
        let mesh =
            shape::place(shape::disc(r), |p| Vec3::new(p.x, -p.y, h as f32), |n| Vec3::new(n.x, -n.y, -n.z));
        let l = lights(vec![Emitter::Area(AreaEmitter::new(&mesh, Spectrum::Constant(2.0), false))]);
        let e = irradiance(&l, Vec3::ZERO, 1 << 15);
        let exact = std::f64::consts::PI * 2.0 * r * r / (r * r + h * h);
        assert!((e / exact - 1.0).abs() < 2e-3, "{e} {exact}");
        // Its back is dark.
        assert_eq!(irradiance(&l, Vec3::new(0.0, 0.0, 60.0), 1 << 8), 0.0);
        assert!(l.emitted(0, -UP, UP, &lambda()).is_zero());
        assert_eq!(l.emitted(0, -UP, -UP, &lambda())[0], 2.0);
    }

    #[test]
    fn point_light_falls_with_the_square() {
        let l = lights(vec![Emitter::Point {
            position: Vec3::new(0.0, 0.0, 20.0),
            intensity: Spectrum::Constant(800.0),
        }]);
        assert!((irradiance(&l, Vec3::ZERO, 1) - 2.0).abs() < 1e-5);
        let s = l.sample(Vec3::new(0.0, 0.0, 10.0), 0.5, Vec2::ZERO, &lambda()).unwrap();
        assert!(s.delta && (s.distance_mm - 10.0).abs() < 1e-4 && (s.radiance[0] - 8.0).abs() < 1e-4);
    }

    #[test]
    fn mixture_is_unbiased() {
        // Overlapping far lights and a near one: together as much as one by one.
        let all = || {
            vec![constant(0.3), cone(Vec3::new(0.2, 0.1, 1.0), 20.0, 2.0), image(), sky(), quad_above(50.0)]
        };
        let together = irradiance(&lights(all()), Vec3::ZERO, 1 << 18);
        let apart: f64 = all().into_iter().map(|e| irradiance(&lights(vec![e]), Vec3::ZERO, 1 << 16)).sum();
        assert!((together / apart - 1.0).abs() < 3e-3, "{together} {apart}");
    }

    #[test]
    fn directions_follow_the_density() {
        let cases = [
            lights(vec![constant(1.0)]),
            lights(vec![image()]),
            lights(vec![sky()]),
            lights(vec![cone(Vec3::new(0.5, 0.2, 0.4), 50.0, 1.0)]),
            lights(vec![constant(0.3), image(), cone(Vec3::new(-0.5, 0.2, 0.4), 50.0, 1.0)]),
        ];
        for (case, l) in cases.iter().enumerate() {
            let (bins, n, fine) = (12usize, 40_000u32, 1200usize);
            let bin = |w: Vec3| {
                let u = warp::sphere_to_square(w) * bins as f32;
                (u.x as usize).min(bins - 1) * bins + (u.y as usize).min(bins - 1)
            };
            let mut seen = vec![0.0f64; bins * bins];
            for i in 0..n {
                // One seed per draw: independent draws, as chi-square wants them.
                let mut s = Sampler::new(u64::from(i) + 1, UVec2::new(case as u32, 3), 0);
                let Some(d) = l.sample(Vec3::ZERO, s.next_1d(), s.next_2d(), &lambda()) else { continue };
                assert!(!d.delta && (d.wi.length() - 1.0).abs() < 1e-5);
                seen[bin(d.wi)] += 1.0;
            }
            let mut expected = vec![0.0f64; bins * bins];
            let mut total = 0.0;
            for i in 0..fine * fine {
                let u = Vec2::new((i % fine) as f32 + 0.5, (i / fine) as f32 + 0.5) / fine as f32;
                let w = warp::square_to_sphere(u);
                let p = f64::from(l.pdf_environment(w, Drawing::One) * 2.0 * TAU) / (fine * fine) as f64;
                total += p;
                expected[bin(w)] += p * f64::from(n);
            }
            assert!((total - 1.0).abs() < 4e-3, "case {case}: the density integrates to {total}");
            let (mut chi2, mut freedom) = (0.0, -1.0);
            for (s, e) in seen.iter().zip(&expected).filter(|(_, e)| **e > 8.0) {
                chi2 += (s - e) * (s - e) / e;
                freedom += 1.0;
            }
            // Mean + 4 standard deviations of chi-square.
            assert!(chi2 < freedom + 4.0 * (2.0f64 * freedom).sqrt(), "case {case}: {chi2} of {freedom}");
        }
    }

    #[test]
    fn area_density_is_the_one_it_is_drawn_with() {
        let l = lights(vec![constant(0.2), quad_above(30.0)]);
        let p = Vec3::new(-20.0, 5.0, 0.0);
        for i in 0..1000 {
            let mut s = Sampler::new(3, UVec2::ZERO, i);
            let Some(d) = l.sample(p, 0.999, s.next_2d(), &lambda()) else { continue };
            let on = p + d.wi * d.distance_mm;
            assert!((on.z - 30.0).abs() < 1e-3);
            assert!((l.pdf_area(1, p, on, -UP, Drawing::One) / d.pdf_per_sr - 1.0).abs() < 1e-3);
        }
        assert_eq!(
            l.pdf_area(1, Vec3::new(0.0, 0.0, 90.0), Vec3::new(15.0, 0.0, 30.0), -UP, Drawing::One),
            0.0
        );
    }

    #[test]
    fn bright_lights_are_picked_more_often_and_none_never() {
        let l = lights(vec![constant(1.0), constant(9.0), constant(0.0)]);
        assert!((l.pick_probability(1) - (0.81 + 0.1 / 3.0)).abs() < 1e-5);
        assert!(l.pick_probability(2) > 0.03);
        assert!(lights(vec![]).sample(Vec3::ZERO, 0.5, Vec2::ZERO, &lambda()).is_none());
    }
}
