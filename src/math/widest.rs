//! Kernels with the widest vector instructions of the machine that runs them.
//!
//! Model: a program is built for the least machine of its kind (x86-64: four lanes). A kernel given to [`widest`] is compiled for wider
//! registers too, and the machine's own is taken at run time. The lanes of plain loops are operations of their own and no product is fused
//! with a sum, so results are the same to the last bit on every machine (`results_do_not_depend_on_the_width`).
//!
//! Limits: only what is inlined into the kernel is compiled anew: its parts are `#[inline(always)]`. A call costs a few nanoseconds:
//! for work of a hundred and more.
//! Source: `pulp`, which looks after the machine's features.

use pulp::Arch;

/// What `kernel` gives; the closure itself is marked, too: `widest(#[inline(always)] || ...)`.
#[inline]
pub fn widest<R>(kernel: impl FnOnce() -> R) -> R {
    Arch::new().dispatch(kernel)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp::{exp, ln};

    #[test]
    fn results_do_not_depend_on_the_width() {
        let kernel = |first: f32| {
            let mut y = [0.0f32; 32];
            for (i, y) in y.iter_mut().enumerate() {
                *y = first + 0.37 * i as f32;
            }
            let sums: [f32; 32] = std::array::from_fn(|i| y[i] * y[31 - i] + ln(y)[i] * 0.3);
            exp(sums.map(|s| -s * 0.01)).map(f32::to_bits)
        };
        for i in 1..2000 {
            let first = i as f32 * 0.013;
            assert_eq!(widest(|| kernel(first)), Arch::Scalar.dispatch(|| kernel(first)));
        }
    }
}
