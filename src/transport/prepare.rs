//! The integrator that a scene asks for, with the solution that it needs.

use std::sync::Arc;

use super::radiosity::{self, Radiosity, RadiositySettings};
use super::{Guide, GuideSettings, Hybrid, Integrator, Path, Progress, RadiosityView, Raytrace};
use crate::Result;
use crate::scene::Scene;
use crate::scene::description::{IntegratorName, RadiosityDescription, RenderDescription};

/// An integrator that is ready to render.
pub struct Prepared {
    /// The integrator.
    pub integrator: Box<dyn Integrator>,
    /// What it takes its diffuse light from, if anything.
    pub solution: Option<Arc<Radiosity>>,
}

impl RadiositySettings {
    /// Settings of a scene.
    pub fn of(render: &RenderDescription) -> Self {
        let RadiosityDescription { elements, rays, light_samples, residual, max_orders, memory_mib, .. } =
            render.radiosity;
        Self {
            elements,
            rays,
            light_samples,
            residual,
            max_orders,
            seed: render.seed,
            memory_bytes: memory_mib.saturating_mul(1 << 20),
            ..Self::default()
        }
    }
}

/// Makes the integrator of `scene.render`. Where it needs a radiosity solution, that is computed: `progress` hears of it and
/// may stop it ([`crate::Error::Cancelled`]), `warnings` gets what is wrong with the scene.
pub fn prepare(scene: &Scene, warnings: &mut Vec<String>, progress: &dyn Progress) -> Result<Prepared> {
    let render = &scene.render;
    let solve = |warnings: &mut Vec<String>| {
        let settings = RadiositySettings::of(render);
        let nm = render.radiosity.wavelengths_nm();
        let solution = radiosity::solve(scene, &nm, &settings, warnings, progress)?;
        if !solution.converged() {
            warnings.push(format!(
                "radiosity stopped after {} orders with {:.1e} of the light still under way",
                solution.orders(),
                solution.residual()
            ));
        }
        Ok::<_, crate::Error>(Arc::new(solution))
    };
    let max_depth = render.max_depth;
    let traced = |integrator: Box<dyn Integrator>| Ok(Prepared { integrator, solution: None });
    match render.integrator {
        IntegratorName::Path => {
            let guide = match render.guide {
                true => Some(Arc::new(Guide::new(scene, &GuideSettings::default(), warnings, progress)?)),
                false => None,
            };
            traced(Box::new(Path { max_depth, min_depth: render.min_depth, guide }))
        }
        IntegratorName::Raytrace => traced(Box::new(Raytrace)),
        IntegratorName::Radiosity => {
            let solution = solve(warnings)?;
            let integrator = Box::new(RadiosityView { solution: solution.clone() });
            Ok(Prepared { integrator, solution: Some(solution) })
        }
        IntegratorName::Hybrid => {
            let solution = solve(warnings)?;
            let near = render.radiosity.near as f32;
            let integrator = Box::new(Hybrid::new(scene, solution.clone(), max_depth, near));
            Ok(Prepared { integrator, solution: Some(solution) })
        }
    }
}
