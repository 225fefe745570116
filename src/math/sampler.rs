//! The sample sequence: Owen-scrambled Sobol points in as many dimensions as a path needs.
//!
//! Model: every pair of dimensions is the first two dimensions of the Sobol sequence with its own hashed
//! nested uniform (Owen) scramble of the points and of their order ("padding"; Burley 2020, "Practical
//! hash-based Owen scrambling", JCGT 9:4; the hash of the scramble is Vegdahl's improved Laine-Karras
//! permutation, 2021). Each pair is a (0,2)-sequence; pairs are mutually independent.
//!
//! A value depends only on (seed, pixel, sample index, dimension): any thread, process or order of work
//! draws the same numbers. The sample index is 32 bits. Guarded by `stratified`, `order_free_and_keyed`.

use glam::{UVec2, Vec2};

/// Draws the dimensions of one sample of one pixel, in order.
#[derive(Clone, Debug)]
pub struct Sampler {
    key: u32,
    index: u32,
    dimension: u32,
}

impl Sampler {
    /// Sequence of sample `index` of `pixel` (absolute coordinates, so that a crop draws what the whole draws).
    pub fn new(seed: u64, pixel: UVec2, index: u32) -> Self {
        let key = hash(
            hash(hash(seed as u32 ^ 0x9e37_79b9) ^ (seed >> 32) as u32)
                ^ pixel.x.wrapping_mul(0x8da6_b343)
                ^ hash(pixel.y),
        );
        Self { key, index, dimension: 0 }
    }

    /// Jumps to a dimension, so that bounce k starts at the same dimension whatever came before.
    pub fn start_dimension(&mut self, dimension: u32) {
        self.dimension = dimension;
    }

    /// The next number in [0, 1).
    pub fn next_1d(&mut self) -> f32 {
        self.next_2d().x
    }

    /// The next stratified pair in [0, 1)^2.
    pub fn next_2d(&mut self) -> Vec2 {
        let key = hash(self.key ^ self.dimension.wrapping_mul(0x9e37_79b9));
        self.dimension = self.dimension.wrapping_add(1);
        let index = owen_scramble(self.index, key);
        let x = owen_scramble(sobol_0(index), hash(key ^ 0x5851_f42d));
        let y = owen_scramble(sobol_1(index), hash(key ^ 0x1405_7b7e));
        Vec2::new(unit(x), unit(y))
    }

    /// An independent sequence with its own dimensions, for a nested computation such as a walk through
    /// cells whose length is not known. Sample `index` of the nested sequence is `i` of `per_sample`
    /// points that this sample draws there.
    pub fn fork(&mut self, i: u32, per_sample: u32) -> Self {
        let key = hash(self.key ^ self.dimension.wrapping_mul(0x85eb_ca6b) ^ 0xc2b2_ae35);
        Self { key, index: self.index.wrapping_mul(per_sample).wrapping_add(i), dimension: 0 }
    }

    /// Skips the dimension that [`Sampler::fork`] used, after the last fork of a group.
    pub fn end_fork(&mut self) {
        self.dimension = self.dimension.wrapping_add(1);
    }
}

/// 24 leading bits to [0, 1); the largest value stays below one in f32.
fn unit(x: u32) -> f32 {
    (x >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// First Sobol dimension: the van der Corput sequence, most significant bit first.
fn sobol_0(index: u32) -> u32 {
    index.reverse_bits()
}

/// Second Sobol dimension: its generator matrix is Pascal's triangle mod 2, and C(j, i) is odd where the
/// binary digits of i are among those of j, so the product is an exclusive-or sum over supersets.
fn sobol_1(index: u32) -> u32 {
    let mut x = index;
    x ^= (x & 0xaaaa_aaaa) >> 1;
    x ^= (x & 0xcccc_cccc) >> 2;
    x ^= (x & 0xf0f0_f0f0) >> 4;
    x ^= (x & 0xff00_ff00) >> 8;
    x ^= (x & 0xffff_0000) >> 16;
    x.reverse_bits()
}

/// Nested uniform scramble of a value whose most significant bit is the first digit.
fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// 32-bit finaliser with low bias (Wellons' search, "lowbias32").
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x21f0_aaad);
    x ^= x >> 15;
    x = x.wrapping_mul(0xd35a_2d97);
    x ^ (x >> 15)
}

/// Uniform number in [0, 1) from a key, for choices that are part of an object rather than of a light path
/// (a petal's ruffle, a disordered cell).
pub fn hash_to_unit(key: u32) -> f64 {
    f64::from(hash(key)) * (1.0 / 4_294_967_296.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stratified() {
        // Any pair of dimensions: 256 points fill each elementary interval of area 1/256 exactly once.
        for dimension in [0, 1, 7, 1000] {
            for (wx, wy) in [(256, 1), (64, 4), (16, 16), (2, 128), (1, 256)] {
                let mut hit = vec![0; 256];
                for i in 0..256 {
                    let mut s = Sampler::new(5, UVec2::new(3, 9), i);
                    s.start_dimension(dimension);
                    let u = s.next_2d();
                    hit[(u.x * wx as f32) as usize * wy + (u.y * wy as f32) as usize] += 1;
                }
                assert!(hit.iter().all(|&h| h == 1), "dimension {dimension}, {wx} x {wy}");
            }
        }
    }

    #[test]
    fn order_free_and_keyed() {
        let draw = |seed, x, i| Sampler::new(seed, UVec2::new(x, 0), i).next_2d();
        assert_eq!(draw(1, 2, 3), draw(1, 2, 3));
        assert_ne!(draw(1, 2, 3), draw(2, 2, 3));
        assert_ne!(draw(1, 2, 3), draw(1, 3, 3));
        assert_ne!(draw(1, 2, 3), draw(1, 2, 4));
        assert_ne!(draw(1, 2, 3), draw(1 << 32 | 1, 2, 3));
    }

    #[test]
    fn dimensions_are_uncorrelated() {
        let n = 1 << 14;
        let mut sum = [0.0f64; 6];
        for i in 0..n {
            let mut s = Sampler::new(0, UVec2::new(1, 1), i);
            let v: Vec<f64> = (0..4).map(|_| f64::from(s.next_1d()) - 0.5).collect();
            for (k, (a, b)) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].into_iter().enumerate() {
                sum[k] += v[a] * v[b];
            }
        }
        // Independent pairs: the mean product has standard deviation 1/(12 sqrt n) = 6.5e-4.
        for s in sum {
            assert!((s / f64::from(n)).abs() < 4.0 * 6.5e-4, "{sum:?}");
        }
    }
}
