//! The clear sky by day, and the ground below it.
//!
//! Model: Perez' distribution over the angle theta from the zenith and gamma from the sun, for luminance Y and for the
//! chromaticity's x and y, each with its own five parameters, and CIE daylight of that chromaticity:
//!
//! ```text
//! F(theta, gamma) = (1 + A exp(B / cos theta)) (1 + C exp(D gamma) + E cos^2 gamma)
//! Y = Y_z F(theta, gamma) / F(0, theta_s),   x and y alike
//! Y_z = (4.0453 T - 4.9710) tan((4/9 - T/120)(pi - 2 theta_s)) - 0.2155 T + 2.4192   kcd/m2
//! L(lambda) = Y S(lambda; x, y) / (683 integral of S y_bar)                          W m-2 sr-1 nm-1
//! below the horizon: L = ground / pi (E_sky + E_sun sin elevation)
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | T | `turbidity` | 1 | 3 |
//! | theta_s | angle of `sun` from +z | radians | |
//! | ground | `ground` | reflectance | 0.2 |
//!
//! Directions are drawn as from an image of the sky's luminance (128 x 64 pixels), L is evaluated exactly.
//! Limits: T from 2 to 10 and a sun above the horizon, where all of it is positive (`stays_positive_in_its_range`). Daylight's
//! components leave no negative light where the sky is orange: there the violet end is cut to zero. The model is known to
//! be too bright (Zotti, Wilkie, Purgathofer 2007): at turbidity 3 its sky gives the ground 1.6 to 1.9 times the light of Hosek and
//! Wilkie's model (as in Mitsuba 3.9, sun at 10, 30 and 60 degrees), in the same colour to 7 %; `sky_scale = 0.55` makes up for it. No clouds, no stars, no night. Guarded by
//! `luminance_is_perez`, `spectrum_has_its_chromaticity`, `ground_reflects_what_falls_on_it`, and for sampling
//! `directions_follow_the_density`, `rays_carry_the_power`.
//! Source: A. Preetham, P. Shirley, B. Smits, A practical analytic model for daylight, SIGGRAPH 1999, appendix 2.

use std::f64::consts::PI;

use glam::{DVec3, DVec4, Vec2, Vec3};

use super::environment::Environment;
use crate::Result;
use crate::spectrum::band::lux_of_one;
use crate::spectrum::daylight::Daylight;
use crate::spectrum::{SampledSpectrum, SampledWavelengths, Spectrum};

/// Rows of the image that directions are drawn from; twice as many columns.
const IMAGE_ROWS: usize = 64;
/// Rows of the quadrature of the sky's light; four times as many columns.
const ROWS: usize = 60;

/// A clear sky with its ground.
#[derive(Clone, Debug)]
pub struct Sky {
    distribution: Distribution,
    scale: f64,
    /// Radiance below the horizon.
    ground: Spectrum,
    /// Radiance of the sky integrated over its directions.
    sky_power: Spectrum,
    image: Environment,
}

impl Sky {
    /// A sky with the sun in the unit direction `sun`, which lights the ground by `sun_irradiance` across its light. `turbidity`
    /// is 2 to 10, and the sun stands above the horizon; `ground` is its reflectance.
    pub(super) fn new(
        sun: DVec3,
        turbidity: f64,
        sun_irradiance: &Spectrum,
        ground: &Spectrum,
        scale: f64,
    ) -> Result<Self> {
        let distribution = Distribution::new(sun, turbidity);
        let (width, height) = (2 * IMAGE_ROWS, IMAGE_ROWS);
        let [sky_power, irradiance] = distribution.integrals(scale);
        let at_ground = irradiance.zip(sun_irradiance, |sky, sun_| sky + sun_ * sun.z as f32);
        let ground = ground.zip(&at_ground, |r, e| r * e / std::f32::consts::PI);
        let ground_luminance = crate::spectrum::Observer::Cie1931.xyz_of(&ground)[1];
        let pixels = (0..width * height).map(|i| {
            let theta = PI * ((i / width) as f64 + 0.5) / height as f64;
            let azimuth = 2.0 * PI * (0.5 - ((i % width) as f64 + 0.5) / width as f64);
            let w = direction(theta, azimuth);
            let y = if w.z > 0.0 { scale * distribution.luminance_and_xy(w)[0] } else { ground_luminance };
            // A sky that is switched off can still be drawn from.
            [y as f32 + 1e-12; 3]
        });
        let image = Environment::new(width, height, pixels.collect(), 0.0)?;
        Ok(Self { distribution, scale, ground, sky_power, image })
    }

    /// Radiance from the unit direction `w`, towards the sky.
    pub fn radiance(&self, w: Vec3, lambda: &SampledWavelengths) -> SampledSpectrum {
        if w.z <= 0.0 {
            return self.ground.sample(lambda);
        }
        let [a, b, c] = self.distribution.factors(w.as_dvec3()).map(|v| (v * self.scale) as f32);
        let [s0, s1, s2] = Daylight::get().components();
        let light = s0.sample(lambda) * a + s1.sample(lambda) * b + s2.sample(lambda) * c;
        light.map(|v| v.max(0.0))
    }

    /// A direction in proportion to the light, with its density, 1/sr.
    pub fn sample(&self, u: Vec2) -> Option<(Vec3, f32)> {
        self.image.sample(u)
    }

    /// Density of [`Sky::sample`], 1/sr.
    pub fn pdf(&self, w: Vec3) -> f32 {
        self.image.pdf(w)
    }

    /// Mean luminance over all directions.
    pub fn mean_luminance(&self) -> f32 {
        self.image.mean_luminance()
    }

    /// Radiance integrated over all directions.
    pub(super) fn integral(&self, lambda: &SampledWavelengths) -> SampledSpectrum {
        self.sky_power.sample(lambda) + self.ground.sample(lambda) * std::f32::consts::TAU
    }
}

fn direction(theta: f64, azimuth: f64) -> DVec3 {
    let (sin, cos) = theta.sin_cos();
    DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
}

/// Luminance, in units of [`lux_of_one`] cd/m2, and chromaticity over the sky.
#[derive(Clone, Debug)]
struct Distribution {
    sun: DVec3,
    /// A to E of Y, x and y.
    perez: [[f64; 5]; 3],
    /// Y, x and y of the zenith, each over F(0, theta_s).
    zenith: [f64; 3],
}

impl Distribution {
    fn new(sun: DVec3, turbidity: f64) -> Self {
        let t = turbidity;
        // Pairs of factor and summand over T.
        const PEREZ: [[(f64, f64); 5]; 3] = [
            [(0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)],
            [(-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)],
            [(-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)],
        ];
        // Over (T^2, T, 1), of (theta_s^3, theta_s^2, theta_s, 1).
        const X: [DVec4; 3] = [
            DVec4::new(0.00166, -0.00375, 0.00209, 0.0),
            DVec4::new(-0.02903, 0.06377, -0.03202, 0.00394),
            DVec4::new(0.11693, -0.21196, 0.06052, 0.25886),
        ];
        const Y: [DVec4; 3] = [
            DVec4::new(0.00275, -0.00610, 0.00317, 0.0),
            DVec4::new(-0.04214, 0.08970, -0.04153, 0.00516),
            DVec4::new(0.15346, -0.26756, 0.06670, 0.26688),
        ];
        let perez = PEREZ.map(|row| row.map(|(factor, summand)| factor * t + summand));
        let theta_s = sun.z.clamp(-1.0, 1.0).acos();
        let powers = DVec4::new(theta_s.powi(3), theta_s.powi(2), theta_s, 1.0);
        let xy = |m: [DVec4; 3]| (m[0] * (t * t) + m[1] * t + m[2]).dot(powers);
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * theta_s);
        let kcd = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
        let mut zenith = [kcd * 1e3 / lux_of_one(), xy(X), xy(Y)];
        for (z, p) in zenith.iter_mut().zip(&perez) {
            *z /= f(p, 1.0, theta_s);
        }
        Self { sun, perez, zenith }
    }

    fn luminance_and_xy(&self, w: DVec3) -> [f64; 3] {
        let gamma = w.dot(self.sun).clamp(-1.0, 1.0).acos();
        std::array::from_fn(|i| self.zenith[i] * f(&self.perez[i], w.z, gamma))
    }

    /// Factors of daylight's components.
    fn factors(&self, w: DVec3) -> [f64; 3] {
        let [luminance, x, y] = self.luminance_and_xy(w);
        Daylight::get().factors(x, y).map(|v| v * luminance)
    }

    /// Radiance integrated over the sky's directions, and over those with the cosine.
    fn integrals(&self, scale: f64) -> [Spectrum; 2] {
        let components = Daylight::get().components();
        let table: Vec<[f64; 3]> =
            (380..=780).map(|nm| [0, 1, 2].map(|i| f64::from(components[i].at(nm as f32)))).collect();
        let mut sums = vec![[0.0; 2]; table.len()];
        let columns = 4 * ROWS;
        for row in 0..ROWS {
            // Rows of equal steps in the angle: the horizon is bright and thin.
            let edges = [row, row + 1].map(|r| (0.5 * PI * r as f64 / ROWS as f64).cos());
            let cos = 0.5 * (edges[0] + edges[1]);
            let solid_angle = 2.0 * PI * (edges[0] - edges[1]) / columns as f64 * scale;
            for column in 0..columns {
                let w = direction(cos.acos(), 2.0 * PI * (column as f64 + 0.5) / columns as f64);
                let [a, b, c] = self.factors(w).map(|v| v * solid_angle);
                for (sum, s) in sums.iter_mut().zip(&table) {
                    let light = (a * s[0] + b * s[1] + c * s[2]).max(0.0);
                    sum[0] += light;
                    sum[1] += light * cos;
                }
            }
        }
        [0, 1].map(|k| Spectrum::from_fn(|nm| sums[(nm - 380.0) as usize][k]))
    }
}

/// Perez' function.
fn f([a, b, c, d, e]: &[f64; 5], cos_theta: f64, gamma: f64) -> f64 {
    let cos_gamma = gamma.cos();
    (1.0 + a * (b / cos_theta.max(1e-6)).exp()) * (1.0 + c * (d * gamma).exp() + e * cos_gamma * cos_gamma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::Observer;

    fn sun(elevation_deg: f64) -> DVec3 {
        direction((90.0 - elevation_deg).to_radians(), 0.4)
    }

    fn sky(elevation_deg: f64, turbidity: f64, ground: f32) -> Sky {
        let (sun_light, ground) = (Spectrum::Constant(0.5), Spectrum::Constant(ground));
        Sky::new(sun(elevation_deg), turbidity, &sun_light, &ground, 1.0).unwrap()
    }

    fn spectrum(sky: &Sky, w: DVec3) -> Spectrum {
        Spectrum::from_fn(|nm| {
            let lambda = SampledWavelengths::given([nm as f32; crate::spectrum::LANES]);
            f64::from(sky.radiance(w.as_vec3(), &lambda)[0])
        })
    }

    #[test]
    fn luminance_is_perez() {
        // Worked by hand with the paper's formulas (an independent program), turbidity 3, sun at 30 degrees: zenith 5139 cd/m2.
        let s = sky(30.0, 3.0, 0.2);
        let luminance = |w: DVec3| Observer::Cie1931.xyz_of(&spectrum(&s, w))[1] * lux_of_one();
        assert!((luminance(DVec3::Z) / 5139.0 - 1.0).abs() < 1e-3, "{}", luminance(DVec3::Z));
        // The sun's surroundings are brightest, the darkest place is far from it and off the zenith, the horizon is brighter.
        let (around, opposite, low) =
            (luminance(sun(30.0)), luminance(direction(0.6, 0.4 + PI)), luminance(direction(1.55, 0.4 + PI)));
        assert!(around > 5.0 * opposite && opposite < 5139.0 && low > opposite, "{around} {opposite} {low}");
    }

    #[test]
    fn spectrum_has_its_chromaticity() {
        let s = sky(40.0, 3.0, 0.2);
        for w in [DVec3::Z, direction(0.8, 2.0), direction(1.3, -1.0)] {
            let [y, cx, cy] = s.distribution.luminance_and_xy(w);
            let xyz = Observer::Cie1931.xyz_of(&spectrum(&s, w));
            let sum: f64 = xyz.iter().sum();
            assert!((xyz[1] / y - 1.0).abs() < 1e-3, "{xyz:?} {y}");
            // The components are daylight's to the rounding of the CIE's numbers.
            assert!(
                (xyz[0] / sum - cx).abs() < 2e-3 && (xyz[1] / sum - cy).abs() < 2e-3,
                "{xyz:?} {cx} {cy}"
            );
            assert!(cx < 0.33, "blue: {cx}");
        }
    }

    #[test]
    fn stays_positive_in_its_range() {
        for turbidity in [2.0, 3.0, 6.0, 10.0] {
            for elevation in [0.0, 1.0, 10.0, 45.0, 90.0] {
                let d = Distribution::new(sun(elevation), turbidity);
                for i in 0..2000 {
                    let w =
                        direction(0.5 * PI * f64::from(i % 50) / 49.5, 2.0 * PI * f64::from(i / 50) / 40.0);
                    let [y, cx, cy] = d.luminance_and_xy(w);
                    assert!(y > 0.0 && y.is_finite(), "{turbidity} {elevation}: {y}");
                    assert!(
                        (0.2..0.55).contains(&cx) && (0.2..0.55).contains(&cy),
                        "{turbidity} {elevation}: {cx} {cy}"
                    );
                    assert!(d.factors(w).iter().all(|v| v.is_finite()));
                }
            }
        }
    }

    #[test]
    fn ground_reflects_what_falls_on_it() {
        let s = sky(30.0, 3.0, 0.4);
        // Irradiance by another quadrature.
        let (n, nm) = (400, 550.0f32);
        let lambda = SampledWavelengths::given([nm; crate::spectrum::LANES]);
        let mut e = 0.5 * 0.5;
        for i in 0..n * n {
            let u = Vec2::new(((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32);
            let w = crate::math::warp::square_to_cosine_hemisphere(u);
            e += PI * f64::from(s.radiance(w, &lambda)[0]) / f64::from(n * n);
        }
        let ground = f64::from(s.radiance(-Vec3::Z, &lambda)[0]);
        assert!((ground / (0.4 * e / PI) - 1.0).abs() < 3e-3, "{ground} {e}");
    }
}
