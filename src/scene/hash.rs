//! A stable 128-bit name for what a scene is: FNV-1a, equal on every machine and in every release.
//!
//! h <- (h xor byte) * 2^88 + 2^8 + 0x3b, from the published offset basis (Fowler, Noll, Vo;
//! draft-eastlake-fnv). Not for security: it tells parts of one picture from parts of another.

/// FNV-1a over bytes, 128 bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fnv128(u128);

impl Fnv128 {
    const OFFSET: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;

    /// The hash of nothing.
    pub(super) fn new() -> Self {
        Self(Self::OFFSET)
    }

    /// Continues with `bytes`.
    pub(super) fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.0 = (self.0 ^ u128::from(b)).wrapping_mul(Self::PRIME);
        }
    }

    /// The value.
    pub(super) fn finish(self) -> u128 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_the_published_vectors() {
        let of = |s: &str| {
            let mut h = Fnv128::new();
            h.write(s.as_bytes());
            h.finish()
        };
        assert_eq!(of(""), 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d);
        assert_eq!(of("a"), 0xd228_cb69_6f1a_8caf_7891_2b70_4e4a_8964);
        assert_eq!(of("foobar"), 0x343e_1662_793c_64bf_6f0d_3597_ba44_6f18);
    }
}
