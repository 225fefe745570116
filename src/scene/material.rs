//! Compiled materials.

use super::assets::Assets;
use super::color::{reflectance, reflectance_and_transmittance};
use super::description::MaterialDescription;
use super::key::Key;
use super::pattern::TissueState;
use super::tabulated::Petal;
use crate::Result;
use std::sync::Arc;

use glam::Vec3;

use crate::bsdf::{Bsdf, DiffuseTransmission, Lambert, LiteralPhong, Phong};
use crate::geometry::Side;
use crate::spectrum::{SampledSpectrum, SampledWavelengths, Spectrum};

/// What a surface is made of. Closed, so that a hit is shaded without an indirect call.
#[derive(Clone, Debug)]
pub enum Material {
    /// Opaque diffuse.
    Lambert(Lambert),
    /// Diffuse and a normalised lobe.
    Phong(Phong),
    /// Phong's formula as written.
    LiteralPhong(LiteralPhong),
    /// Diffuse reflection and transmission.
    Diffuse(DiffuseTransmission),
    /// The scene's petal, or another tissue.
    Petal(Arc<Petal>),
}

/// How a material scatters light.
#[derive(Clone, Copy)]
pub enum Scattering<'a> {
    /// Alike all over the surface.
    Bsdf(&'a dyn Bsdf),
    /// As the petal does, which varies over it.
    Petal(&'a Petal),
}

impl Material {
    /// Reflects nothing: the body of an area light.
    pub(super) fn black() -> Result<Self> {
        Ok(Material::Lambert(Lambert::new(Spectrum::Constant(0.0))?))
    }

    /// Checks and compiles a material.
    pub(super) fn compile(
        d: &MaterialDescription,
        petal: &Arc<Petal>,
        key: &Key,
        assets: &dyn Assets,
    ) -> Result<Self> {
        let spectrum = |d, name: &str| reflectance(d, &key.at(name), assets);
        Ok(match d {
            MaterialDescription::Lambert(m) => {
                Material::Lambert(key.under(Lambert::new(spectrum(&m.reflectance, "reflectance")?))?)
            }
            MaterialDescription::Phong(m) => Material::Phong(key.under(Phong::new(
                spectrum(&m.diffuse, "diffuse")?,
                spectrum(&m.specular, "specular")?,
                m.exponent as f32,
            ))?),
            MaterialDescription::LiteralPhong(m) => Material::LiteralPhong(key.under(LiteralPhong::new(
                spectrum(&m.diffuse, "diffuse")?,
                spectrum(&m.specular, "specular")?,
                m.exponent as f32,
            ))?),
            MaterialDescription::Diffuse(m) => {
                let adaxial_key = key.at("reflectance_adaxial");
                let transmittance_key = key.at("transmittance");
                let transmittance = (&m.transmittance, &transmittance_key);
                let (adaxial, mut t) = reflectance_and_transmittance(
                    (&m.reflectance_adaxial, &adaxial_key),
                    transmittance,
                    assets,
                )?;
                let abaxial = match &m.reflectance_abaxial {
                    None => adaxial.clone(),
                    Some(d) => {
                        let abaxial_key = key.at("reflectance_abaxial");
                        let (abaxial, t_abaxial) =
                            reflectance_and_transmittance((d, &abaxial_key), transmittance, assets)?;
                        // Light passes alike both ways: where the two fits differ, the smaller fits both.
                        t = t.zip(&t_abaxial, f32::min);
                        abaxial
                    }
                };
                Material::Diffuse(key.under(DiffuseTransmission::new(adaxial, abaxial, t))?)
            }
            MaterialDescription::Petal(_) => Material::Petal(petal.clone()),
            MaterialDescription::Tissue(m) => {
                Material::Petal(Arc::new(m.petal.build(&key.at("petal").to_string(), assets)?))
            }
        })
    }

    /// How light is scattered at the surface.
    pub fn scattering(&self) -> Scattering<'_> {
        match self {
            Material::Lambert(m) => Scattering::Bsdf(m),
            Material::Phong(m) => Scattering::Bsdf(m),
            Material::LiteralPhong(m) => Scattering::Bsdf(m),
            Material::Diffuse(m) => Scattering::Bsdf(m),
            Material::Petal(m) => Scattering::Petal(m),
        }
    }

    /// Share of light from the local direction `wi` that comes through the sheet, where its tissue is in a state.
    pub fn transmittance(
        &self,
        wi: Vec3,
        state: TissueState,
        lambda: &SampledWavelengths,
    ) -> SampledSpectrum {
        match self {
            Material::Diffuse(m) => m.transmittance().sample(lambda),
            Material::Petal(m) => m.transmittance(wi, state, lambda),
            _ => SampledSpectrum::ZERO,
        }
    }

    /// Colour of the surface seen from the local direction `wo`, transmitted light included: a guide for
    /// denoisers and masks, not for transport.
    pub fn albedo(&self, wo: Vec3, state: TissueState, lambda: &SampledWavelengths) -> SampledSpectrum {
        let side = Side::of(wo);
        match self {
            Material::Lambert(m) => m.reflectance(side).sample(lambda),
            Material::Phong(m) => m.diffuse().sample(lambda) + m.specular().sample(lambda),
            Material::LiteralPhong(m) => m.diffuse().sample(lambda),
            Material::Diffuse(m) => m.reflectance(side).sample(lambda) + m.transmittance().sample(lambda),
            Material::Petal(m) => m.albedo(wo, state, lambda),
        }
    }
}
