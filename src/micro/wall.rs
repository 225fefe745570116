//! A wall between two media: what it reflects, and where the rest goes on.
//!
//! Model: a cell's wall is a plate of index n_w between media of index n_1 and n_2, thin against a cell and thick against
//! the coherence of sunlight. Each face reflects by Fresnel's equations; the light between the faces is summed
//! incoherently, for each polarisation apart; light is unpolarised:
//!
//! ```text
//! R = 1/2 sum over polarisations of (r_1 + r_2 - 2 r_1 r_2) / (1 - r_1 r_2),     n_1 sin_1 = n_w sin_w = n_2 sin_2
//! ```
//!
//! Where one of the sines would exceed one the wall reflects all light. The way within the wall is neglected: light leaves it
//! where it entered it. With n_w = n_2 the wall is a single face.
//!
//! | symbol | field |
//! |---|---|
//! | n_1, n_w, n_2 | `outer_index`, `wall_index`, `inner_index` |
//!
//! Limits: reflection is the same from both sides at conjugate angles (`wall_is_reciprocal`), a matched wall is not there,
//! (`matched_wall_is_not_there`); waves that tunnel through a thin wall beyond the critical angle are left out.
//! Sources: Fresnel; the sum over a plate's faces is textbook optics (Born and Wolf, section 7.6, without interference).

/// Indices of refraction across a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Medium on the side that the normal points to.
    pub outer_index: f64,
    /// The wall.
    pub wall_index: f64,
    /// Medium on the other side.
    pub inner_index: f64,
}

/// What happens to light that meets a wall under some angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Share that is reflected, 0 to 1.
    pub reflectance: f64,
    /// Cosine, from the wall's normal, of the light that passes; 0 where none does.
    pub cos_through: f64,
    /// Index here over index beyond: what the tangential part of the direction is multiplied by.
    pub index_ratio: f64,
}

impl Wall {
    /// Light that meets the wall with `cos` (0 to 1) from the normal, from the outer side or from the inner one.
    pub fn meet(&self, cos: f64, from_outer: bool) -> Meeting {
        let (here, beyond) = if from_outer {
            (self.outer_index, self.inner_index)
        } else {
            (self.inner_index, self.outer_index)
        };
        let index_ratio = here / beyond;
        // (n sin)^2 is the same in all three media.
        let invariant = here * here * (1.0 - cos * cos).max(0.0);
        let cos_in = |n: f64| 1.0 - invariant / (n * n);
        let (wall2, beyond2) = (cos_in(self.wall_index), cos_in(beyond));
        if wall2 <= 0.0 || beyond2 <= 0.0 {
            return Meeting { reflectance: 1.0, cos_through: 0.0, index_ratio };
        }
        let (cos_wall, cos_through) = (wall2.sqrt(), beyond2.sqrt());
        let first = fresnel((here, cos), (self.wall_index, cos_wall));
        let second = fresnel((self.wall_index, cos_wall), (beyond, cos_through));
        let plate = |a: f64, b: f64| if a * b >= 1.0 { 1.0 } else { (a + b - 2.0 * a * b) / (1.0 - a * b) };
        let reflectance = 0.5 * (plate(first[0], second[0]) + plate(first[1], second[1]));
        Meeting { reflectance, cos_through, index_ratio }
    }
}

/// Reflectances of one face for light polarised across and along the plane of incidence.
fn fresnel((n_a, cos_a): (f64, f64), (n_b, cos_b): (f64, f64)) -> [f64; 2] {
    let ratio = |a: f64, b: f64| {
        let r = (a - b) / (a + b);
        r * r
    };
    [ratio(n_a * cos_a, n_b * cos_b), ratio(n_b * cos_a, n_a * cos_b)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: Wall = Wall { outer_index: 1.0, wall_index: 1.425, inner_index: 1.35 };

    #[test]
    fn upright_light_and_brewster() {
        let glass = Wall { outer_index: 1.0, wall_index: 1.5, inner_index: 1.5 };
        assert!((glass.meet(1.0, true).reflectance - 0.04).abs() < 1e-12);
        // At Brewster's angle light along the plane passes: half of ((1 - n^2)/(1 + n^2))^2 is left.
        let cos = (1.0f64 / (1.0 + 2.25)).sqrt();
        let r = glass.meet(cos, true).reflectance;
        assert!((r - 0.5 * (1.25f64 / 3.25).powi(2)).abs() < 1e-12, "{r}");
        // Two faces: r1 = (0.425/2.425)^2, r2 = (0.075/2.775)^2.
        let (a, b) = ((0.425f64 / 2.425).powi(2), (0.075f64 / 2.775).powi(2));
        let expected = a + (1.0 - a).powi(2) * b / (1.0 - a * b);
        assert!((CELL.meet(1.0, true).reflectance - expected).abs() < 1e-12);
    }

    #[test]
    fn wall_is_reciprocal() {
        for i in 1..100 {
            let cos = f64::from(i) / 100.0;
            let there = CELL.meet(cos, true);
            let back = CELL.meet(there.cos_through, false);
            assert!((there.reflectance - back.reflectance).abs() < 1e-12, "{cos}");
            assert!((back.cos_through - cos).abs() < 1e-12);
            assert!((0.0..=1.0).contains(&there.reflectance));
        }
        // Beyond the critical angle, sin = 1/1.35.
        let critical = (1.0 - 1.0 / (1.35f64 * 1.35)).sqrt();
        assert_eq!(CELL.meet(critical * 0.999, false).reflectance, 1.0);
        assert!(CELL.meet(critical * 1.01, false).reflectance < 1.0);
        assert_eq!(CELL.meet(0.0, true).reflectance, 1.0);
    }

    #[test]
    fn matched_wall_is_not_there() {
        let none = Wall { outer_index: 1.35, wall_index: 1.35, inner_index: 1.35 };
        for cos in [1.0, 0.5, 0.01] {
            let m = none.meet(cos, true);
            assert!(m.reflectance < 1e-20 && (m.cos_through - cos).abs() < 1e-12 && m.index_ratio == 1.0);
        }
    }
}
