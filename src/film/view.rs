//! Scene light to a picture for a screen: what a photographer sets after the exposure was made.
//!
//! Model, for the light rgb of a pixel at the place p of the picture (from its middle, in half heights):
//!
//! ```text
//! rgb1 = B rgb                                      white balance: B = M^-1 A^-1 diag(A w_D65 / A w) A M
//! rgb2 = rgb1 (1 + (p tan(fov / 2))^2)^(-2 v)       cos^4 of the angle off the axis, v times over
//! rgb3 = rgb2 (1 + g sqrt(0.18 / Y2) n)             noise of counted light: its deviation goes with the root of the light
//! screen = curve(2^ev rgb3)                         Y2 is the luminance after exposure, n standard normal by pixel and seed
//! ```
//!
//! | symbol | field | unit | default |
//! |---|---|---|---|
//! | w | white of `white_balance_k` and `tint` | K, 1/3000 of CIE 1960 uv | none: D65 |
//! | v | `vignetting` | 1 | 0; 1 is what a simple lens of this angle does |
//! | g | `grain` | deviation at middle grey, relative | 0 |
//! | ev | `exposure_ev` | stops | 0 |
//!
//! A: Bradford's cone responses, M: linear sRGB to XYZ. All of it is applied to what is shown; files of scene light keep the light.
//! Limits: a white balance maps one white, other colours follow by their cone responses only; the grain of neighbouring pixels is
//! independent. Guarded by `balance_turns_its_white_to_grey`, `tint_goes_from_green_to_magenta`, `corners_fall_with_cos4`,
//! `grain_is_counted_light`.
//! Source: K. Lam, Metamerism and colour constancy, thesis, University of Bradford, 1985, as in ICC.1:2022 annex E; cos^4 law and
//! Poisson noise, any textbook.

use glam::{DMat3, DVec3, Mat3, UVec2, Vec3};

use super::film::Film;
use super::tonemap::ToneMap;
use crate::math::sampler::{hash, hash_to_unit};
use crate::spectrum::Observer;
use crate::spectrum::color::luminance;
use crate::spectrum::daylight::white_of;
use crate::{Error, Result};

/// How light is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Exposure, stops.
    pub exposure_ev: f32,
    /// Curve to the screen.
    pub tone_map: ToneMap,
    /// On linear sRGB; [`white_balance`] makes one.
    pub balance: Mat3,
    /// Strength of the fall of light towards the corners.
    pub vignetting: f32,
    /// Tangent of half the angle of the picture's height.
    pub tan_half_fov: f32,
    /// Relative deviation of the grain at middle grey.
    pub grain: f32,
    /// Seed of the grain.
    pub seed: u64,
}

impl View {
    /// Exposure and curve alone.
    pub fn plain(exposure_ev: f32, tone_map: ToneMap) -> Self {
        Self {
            exposure_ev,
            tone_map,
            balance: Mat3::IDENTITY,
            vignetting: 0.0,
            tan_half_fov: 0.0,
            grain: 0.0,
            seed: 0,
        }
    }

    /// sRGB-encoded screen colours of a film, or of `light` (linear sRGB) in place of the film's own.
    pub fn develop(&self, film: &Film, light: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let size = film.resolution();
        light.iter().enumerate().map(|(i, &rgb)| self.show(rgb, film.position(i), size)).collect()
    }

    /// sRGB-encoded screen colour, each channel in [0, 1], of linear sRGB light in a pixel of a picture of `size` pixels.
    pub fn show(&self, rgb: [f32; 3], pixel: UVec2, size: UVec2) -> [f32; 3] {
        let mut light = Vec3::from(rgb);
        if self.balance != Mat3::IDENTITY {
            light = (self.balance * light).max(Vec3::ZERO);
        }
        if self.vignetting > 0.0 {
            let p = (pixel.as_vec2() + 0.5 - size.as_vec2() / 2.0) / (size.y as f32 / 2.0);
            let tan_squared = (p * self.tan_half_fov).length_squared();
            light *= (1.0 + tan_squared).powf(-2.0 * self.vignetting);
        }
        if self.grain > 0.0 {
            let y = luminance(light.to_array()) * self.exposure_ev.exp2();
            if y > 0.0 {
                light *= (1.0 + self.grain * (0.18 / y).sqrt() * self.noise(pixel)).max(0.0);
            }
        }
        self.tone_map.encode(light.to_array(), self.exposure_ev)
    }

    /// Standard normal, by seed and pixel.
    fn noise(&self, pixel: UVec2) -> f32 {
        let seed = hash(self.seed as u32 ^ hash((self.seed >> 32) as u32 ^ 0x6772_6169));
        let key = hash(pixel.x ^ hash(pixel.y ^ seed));
        let (u, v) = (1.0 - hash_to_unit(key), hash_to_unit(key ^ 0x9e37_79b9));
        ((-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()) as f32
    }
}

/// Least response of a Bradford cone, relative to the luminance, of what can be made white. Candle light, 1900 K, has 0.15.
const LEAST_CONE: f64 = 0.05;

/// Matrix on linear sRGB that makes the light of a temperature white; `tint` says by how much the light was greener than that
/// temperature's own (in 1/3000 of CIE 1960 uv, as photographers' programs count), so that the picture becomes more magenta.
pub fn white_balance(temperature_k: f64, tint: f64) -> Result<Mat3> {
    const BRADFORD: DMat3 =
        DMat3::from_cols_array(&[0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296]);
    if !(-150.0..=150.0).contains(&tint) {
        return Err(Error::invalid("tint", format!("{tint} is not within -150 to 150")));
    }
    let white = white_of(temperature_k)?;
    // Along the locus of temperatures, and across it to the green side.
    let (low, high) =
        (white_of((temperature_k * 0.99).max(1500.0))?, white_of((temperature_k * 1.01).min(25_000.0))?);
    let along = (uv(high) - uv(low)).normalize();
    // Temperature lowers u, so this is where v, and green, grows.
    let green = DVec3::new(along.y, -along.x, 0.0);
    let [x, y] = xy(uv(white) + green * (tint / 3000.0));
    if !(x > 0.0 && y > 0.0 && x + y < 1.0) {
        return Err(Error::invalid("tint", format!("{tint} at {temperature_k} K is no colour of a light")));
    }
    let observer = Observer::Cie1931;
    let cones = |xyz: DVec3| BRADFORD * xyz;
    let from = cones(DVec3::new(x / y, 1.0, (1.0 - x - y) / y));
    // Towards the edge of all colours a cone sees next to nothing, and its gain would be noise.
    if from.min_element() < LEAST_CONE {
        return Err(Error::invalid(
            "tint",
            format!("{tint} at {temperature_k} K is too saturated to be white"),
        ));
    }
    let gains = cones(observer.white()) / from;
    let adapt = BRADFORD.inverse() * DMat3::from_diagonal(gains) * BRADFORD;
    Ok((observer.srgb_from_xyz() * adapt * observer.xyz_from_srgb()).as_mat3())
}

/// CIE 1960 (u, v) of (x, y); z is zero.
fn uv([x, y]: [f64; 2]) -> DVec3 {
    let d = -2.0 * x + 12.0 * y + 3.0;
    DVec3::new(4.0 * x / d, 6.0 * y / d, 0.0)
}

fn xy(uv: DVec3) -> [f64; 2] {
    let d = 2.0 * uv.x - 8.0 * uv.y + 4.0;
    [3.0 * uv.x / d, 2.0 * uv.y / d]
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::spectrum::Illuminant;

    fn srgb_of(illuminant: Illuminant) -> Vec3 {
        let xyz = Observer::Cie1931.xyz_of(&illuminant.spectrum().unwrap());
        (Observer::Cie1931.srgb_from_xyz() * DVec3::from(xyz)).as_vec3()
    }

    #[test]
    fn balance_turns_its_white_to_grey() {
        for (illuminant, k) in [
            (Illuminant::A, 2856.0),
            (Illuminant::Blackbody(2000.0), 2000.0),
            (Illuminant::D50, 5003.0),
            (Illuminant::D65, 6504.0),
        ] {
            let seen = srgb_of(illuminant);
            let balanced = white_balance(k, 0.0).unwrap() * seen;
            assert!((balanced - Vec3::splat(balanced.y)).abs().max_element() < 4e-3, "{k} K: {balanced}");
            assert!((luminance(balanced.to_array()) - 1.0).abs() < 1e-3);
        }
        // Daylight's own white changes nothing.
        let same = white_balance(6504.0, 0.0).unwrap();
        assert!((same * Vec3::new(0.5, 0.1, 0.02) - Vec3::new(0.5, 0.1, 0.02)).abs().max_element() < 2e-3);
        for (k, tint) in
            [(f64::NAN, 0.0), (1000.0, 0.0), (30_000.0, 0.0), (6500.0, 151.0), (6500.0, f64::NAN)]
        {
            assert!(white_balance(k, tint).is_err(), "{k} {tint}");
        }
    }

    #[test]
    fn tint_goes_from_green_to_magenta() {
        for k in [3000.0, 4500.0, 6500.0, 12_000.0, 25_000.0] {
            let grey = |tint| white_balance(k, tint).unwrap() * srgb_of(Illuminant::D65);
            let (green, own, magenta) = (grey(-60.0), grey(0.0), grey(60.0));
            let greenness = |c: Vec3| c.y / (c.x + c.z);
            assert!(greenness(green) > 1.02 * greenness(own), "{k} K: {green} {own}");
            assert!(greenness(magenta) < 0.98 * greenness(own), "{k} K: {magenta} {own}");
        }
    }

    #[test]
    fn corners_fall_with_cos4() {
        let size = UVec2::new(300, 200);
        let view = View { vignetting: 1.0, tan_half_fov: 0.5, ..View::plain(0.0, ToneMap::Linear) };
        let at = |view: &View, x, y| srgb_decoded(view.show([0.5; 3], UVec2::new(x, y), size));
        let tan = |x: f32, y: f32| 0.5 * Vec2::new(x + 0.5 - 150.0, y + 0.5 - 100.0).length() / 100.0;
        for (x, y) in [(0, 0), (150, 100), (299, 50)] {
            let expected = 0.5 * tan(x as f32, y as f32).atan().cos().powi(4);
            assert!((at(&view, x, y) - expected).abs() < 1e-4, "{x} {y}");
        }
        assert!((at(&View::plain(0.0, ToneMap::Linear), 0, 0) - 0.5).abs() < 1e-5);
    }

    fn srgb_decoded(screen: [f32; 3]) -> f32 {
        crate::spectrum::color::srgb_decode(screen[1])
    }

    #[test]
    fn grain_is_counted_light() {
        let n = 128;
        let moments = |grey: f32, ev: f32, seed: u64| {
            let view = View { grain: 0.05, seed, ..View::plain(ev, ToneMap::Linear) };
            let all: Vec<f64> = (0..n * n)
                .map(|i| {
                    f64::from(srgb_decoded(view.show([grey; 3], UVec2::new(i % n, i / n), UVec2::splat(n))))
                })
                .collect();
            let mean = all.iter().sum::<f64>() / all.len() as f64;
            (mean, (all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / all.len() as f64).sqrt())
        };
        // At middle grey 5 %, at a quarter of it twice that relative deviation; exposure is part of what is counted.
        for (grey, ev, expected) in
            [(0.18, 0.0, 0.05), (0.045, 0.0, 0.1), (0.045, 2.0, 0.05), (0.72, 0.0, 0.025)]
        {
            let (mean, deviation) = moments(grey, ev, 3);
            let level = f64::from(grey * ev.exp2());
            assert!((mean / level - 1.0).abs() < 4.0 * expected / f64::from(n), "{grey}: {mean}");
            assert!((deviation / mean / expected - 1.0).abs() < 0.03, "{grey}: {deviation}");
        }
        assert_eq!(moments(0.18, 0.0, 3), moments(0.18, 0.0, 3));
        assert_ne!(moments(0.18, 0.0, 3), moments(0.18, 0.0, 1 << 32 | 3));
    }
}
