//! Stands in for modules that this one builds on until they arrive.

pub(super) mod io {
    use crate::geometry::Mesh;

    pub(in crate::scene) fn read_mesh(_: &[u8]) -> crate::Result<Mesh> {
        Err(crate::Error::Unsupported("mesh files".to_owned()))
    }

    pub(in crate::scene) mod image {
        pub(in crate::scene) const MAX_PIXELS: u64 = 1 << 26;
        pub(in crate::scene) struct Image {
            pub(in crate::scene) width: usize,
            pub(in crate::scene) height: usize,
            pub(in crate::scene) rgb: Vec<[f32; 3]>,
        }
        pub(in crate::scene) fn read(_: &[u8], _: u64) -> crate::Result<Image> {
            Err(crate::Error::Unsupported("image files".to_owned()))
        }
    }
}
