//! Compiled materials.

use super::assets::Assets;
use super::color::{reflectance, reflectance_and_transmittance};
use super::description::MaterialDescription;
use super::key::Key;
use crate::Result;
use crate::bsdf::{DiffuseTransmission, Lambert, LiteralPhong, Phong};
use crate::spectrum::Spectrum;

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
    /// The cells of the scene's petal.
    Petal,
}

impl Material {
    /// Reflects nothing: the body of an area light.
    pub(super) fn black() -> Result<Self> {
        Ok(Material::Lambert(Lambert::new(Spectrum::Constant(0.0))?))
    }

    /// Checks and compiles a material.
    pub(super) fn compile(d: &MaterialDescription, key: &Key, assets: &dyn Assets) -> Result<Self> {
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
            MaterialDescription::Petal(_) => Material::Petal,
        })
    }
}
