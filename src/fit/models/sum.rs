//! The sum of models: their parameters one after another.

use crate::Result;
use crate::fit::model::{Geometry, Model, Parameter, Prepared};

/// A model that is the sum of others; no two of them may have a parameter of the same name.
pub struct Sum {
    name: String,
    parts: Vec<Box<dyn Model>>,
    parameters: Vec<Parameter>,
}

impl Sum {
    /// With the name that it has on the command line.
    pub fn new(name: &str, parts: Vec<Box<dyn Model>>) -> Self {
        let parameters = parts.iter().flat_map(|m| m.parameters().iter().cloned()).collect();
        Self { name: name.into(), parts, parameters }
    }
}

impl Model for Sum {
    fn name(&self) -> &str {
        &self.name
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn prepare(&self, geometries: &[Geometry]) -> Result<Box<dyn Prepared>> {
        let parts = self.parts.iter().map(|m| Ok((m.parameters().len(), m.prepare(geometries)?)));
        Ok(Box::new(At(parts.collect::<Result<_>>()?)))
    }
}

/// Each part with the number of its parameters.
struct At(Vec<(usize, Box<dyn Prepared>)>);

impl Prepared for At {
    fn eval(&self, p: &[f64], values: &mut [f64], jacobian: Option<&mut [f64]>) {
        let n = values.len();
        values.fill(0.0);
        let mut part_values = vec![0.0; n];
        let (mut p, mut jacobian) = (p, jacobian);
        for (parameters, part) in &self.0 {
            let (own, rest) = p.split_at(*parameters);
            p = rest;
            let own_jacobian = jacobian.take().map(|j| {
                let (own, rest) = j.split_at_mut(parameters * n);
                jacobian = Some(rest);
                own
            });
            part.eval(own, &mut part_values, own_jacobian);
            values.iter_mut().zip(&part_values).for_each(|(v, x)| *v += x);
        }
    }
}
