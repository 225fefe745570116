//! A picture of the light on what the camera sees, in false colours.
//!
//! Model: rays through random points of each pixel; the colour is that of the quantity on the side that is seen, at the
//! point that is met, in one band: linear between the values at vertices (`surface.rs`). The colours of a pixel's rays are averaged, so edges are smooth and no value
//! is mixed with its background. Lights and the background are grey. The scale
//! ends at a round number that a hundredth of the seen points may exceed. Guarded by `the_view_shows_the_irradiance`.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::{UVec2, Vec2};
use rayon::prelude::*;

use super::surface::Surface;
use super::{Readout, SIDES};
use crate::geometry::Side;
use crate::io::false_color::{self, Scale};
use crate::math::Sampler;
use crate::transport::Progress;
use crate::transport::radiosity::Quantity;
use crate::{Error, Result};

/// Colour of what has no value.
const GREY: [f32; 3] = [0.6; 3];

/// What is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewSettings {
    /// What of the light.
    pub quantity: Quantity,
    /// Number of the band.
    pub band: usize,
    /// Photons instead of watts?
    pub photons: bool,
    /// Value of the brightest colour; `None`: a round number.
    pub max: Option<f64>,
    /// Rays per pixel.
    pub samples: u32,
}

/// Values of the points that the camera sees.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// For each pixel, row by row from the top, the values of its rays; NaN where there is none.
    pub values: Vec<f32>,
}

/// A side of a shape, and what is shown at its vertices.
type Shown = (Surface, Vec<f32>);

impl Readout<'_> {
    /// What the camera sees.
    pub fn view(&self, settings: &ViewSettings, progress: &dyn Progress) -> Result<View> {
        let film = &self.scene.film;
        let (width, height) = (film.width, film.height);
        if settings.band >= self.bands.len() || settings.samples == 0 {
            return Err(Error::invalid("view", "no such band, or no rays"));
        }
        let size = u64::from(width) * u64::from(height) * u64::from(settings.samples);
        if size > 1 << 28 {
            return Err(Error::invalid("film", format!("{size} rays of the map are more than 2^28")));
        }
        let surfaces = self.shown_surfaces(settings);
        let mut values = vec![f32::NAN; size as usize];
        let done = AtomicU64::new(0);
        let row = width as usize * settings.samples as usize;
        values.par_chunks_mut(row).enumerate().for_each(|(y, row)| {
            if progress.cancelled() {
                return;
            }
            for (x, pixel) in row.chunks_mut(settings.samples as usize).enumerate() {
                let pixel_at = UVec2::new(x as u32, y as u32);
                for (i, value) in (0..).zip(pixel) {
                    *value = self.seen(pixel_at, i, &surfaces).unwrap_or(f32::NAN);
                }
            }
            progress.advance(done.fetch_add(1, Ordering::Relaxed) + 1, u64::from(height));
        });
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        Ok(View { width, height, values })
    }

    /// The sides of the shapes that do not glow, with what is shown at their vertices.
    fn shown_surfaces(&self, settings: &ViewSettings) -> Vec<Option<[Shown; 2]>> {
        let count = self.radiosity.wavelengths_nm().len();
        let of_side = |shape: usize, side: Side| {
            let mut surface = self.surface(shape, side, settings.quantity);
            let shown = surface.values.chunks(count).map(|v| self.shown(settings, v)).collect();
            surface.values = Vec::new();
            (surface, shown)
        };
        let lit = |s: usize| self.scene.shapes[s].emitter.is_none();
        let of_shape = |s: usize| lit(s).then(|| SIDES.map(|side| of_side(s, side)));
        (0..self.scene.shapes.len()).into_par_iter().map(of_shape).collect()
    }

    fn shown(&self, settings: &ViewSettings, values: &[f32]) -> f32 {
        self.flux(settings.band, |i| f64::from(values[i]))[usize::from(settings.photons)] as f32
    }

    fn seen(&self, pixel: UVec2, index: u32, surfaces: &[Option<[Shown; 2]>]) -> Option<f32> {
        let mut sampler = Sampler::new(0, pixel, index);
        let size = Vec2::new(self.scene.film.width as f32, self.scene.film.height as f32);
        let place = (pixel.as_vec2() + sampler.next_2d()) / size;
        let ray = self.scene.camera.ray(place, sampler.next_2d()).ray;
        let at = self.scene.intersect(&ray)?;
        let side = if at.ng.dot(ray.direction) < 0.0 { Side::Adaxial } else { Side::Abaxial };
        let (surface, shown) = &surfaces[at.shape as usize].as_ref()?[side as usize];
        let (corners, b) = self.corners_at(surface, &at)?;
        Some((0..3).map(|k| b[k] * shown[corners[k] as usize]).sum())
    }

    /// The map as PNG bytes, with a bar that says what the colours mean.
    pub fn map(&self, settings: &ViewSettings, progress: &dyn Progress) -> Result<Vec<u8>> {
        let view = self.view(settings, progress)?;
        let max = settings.max.map_or_else(|| round_end(&view.values), |m| m as f32);
        let scale = Scale::Viridis { max };
        let mean = |rays: &[f32]| {
            let mut sum = [0.0; 3];
            for v in rays {
                let color = if v.is_nan() { GREY } else { scale.linear(*v) };
                for c in 0..3 {
                    sum[c] += color[c] / rays.len() as f32;
                }
            }
            sum
        };
        let pixels: Vec<[f32; 3]> = view.values.chunks(settings.samples as usize).map(mean).collect();
        let what = match settings.quantity {
            Quantity::Incident => "irradiance",
            Quantity::Absorbed => "absorbed",
            Quantity::Transmitted => "transmitted",
            Quantity::Leaving => "radiosity",
        };
        let unit = if settings.photons { "µmol m⁻² s⁻¹" } else { "W m⁻²" };
        let caption = format!("{what}, {unit}, {} nm", self.bands[settings.band]);
        false_color::write_colors(&pixels, view.width as usize, scale, &caption)
    }
}

/// The round number at or above what a hundredth of the values exceed; its quarters are round too.
fn round_end(values: &[f32]) -> f32 {
    const ROUND: [f32; 11] = [1.0, 1.2, 1.6, 2.0, 2.4, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    let mut seen: Vec<f32> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let Some(last) = seen.len().checked_sub(1) else { return 1.0 };
    let (_, high, _) = seen.select_nth_unstable_by(last - last / 100, f32::total_cmp);
    if *high <= 0.0 {
        return 1.0;
    }
    let decade = 10f32.powf(high.log10().floor());
    ROUND.into_iter().map(|r| r * decade).find(|r| r >= high).unwrap_or(10.0 * decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_round() {
        assert_eq!(round_end(&[0.0, 287.0, f32::NAN]), 300.0);
        assert_eq!(round_end(&[1.0; 7]), 1.0);
        assert!((round_end(&[0.013]) - 0.016).abs() < 1e-6);
        let mut many = vec![5.5; 1000];
        many[3] = 1e6;
        assert_eq!(round_end(&many), 6.0);
        assert_eq!((round_end(&[]), round_end(&[0.0])), (1.0, 1.0));
    }
}
