//! Stands in for modules that this one builds on until they arrive.

pub(super) mod micro {
    use schemars::JsonSchema;
    use serde::{Deserialize, Serialize};

    /// Cells of a petal.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields, default)]
    pub struct CellDescription {
        /// Distance between neighbouring centres, um.
        pub pitch_um: f64,
    }

    impl Default for CellDescription {
        fn default() -> Self {
            Self { pitch_um: 23.0 }
        }
    }

    impl CellDescription {
        pub(in crate::scene) fn validate(&self, at: &str) -> crate::Result<()> {
            if self.pitch_um > 0.0 {
                Ok(())
            } else {
                Err(crate::Error::invalid(format!("{at}.pitch_um"), "must be above 0"))
            }
        }
    }
}

pub(super) mod flower {
    use schemars::JsonSchema;
    use serde::{Deserialize, Serialize};

    use crate::geometry::Mesh;

    /// A rose.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields, default)]
    pub struct RoseDescription {
        /// Number of petals.
        pub petals: u32,
    }

    impl Default for RoseDescription {
        fn default() -> Self {
            Self { petals: 36 }
        }
    }

    impl std::str::FromStr for RoseDescription {
        type Err = crate::Error;
        fn from_str(name: &str) -> crate::Result<Self> {
            match name {
                "hybrid_tea" | "cupped" | "wild" => Ok(Self::default()),
                _ => Err(crate::Error::invalid("preset", format!("no rose is called `{name}`"))),
            }
        }
    }

    impl RoseDescription {
        pub(in crate::scene) fn validate(&self, _at: &str) -> crate::Result<()> {
            Ok(())
        }
    }

    /// What an organ is.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[allow(missing_docs)]
    pub enum OrganKind {
        Petal,
        Sepal,
        Receptacle,
        Stem,
        Leaf,
    }

    /// One mesh of a flower.
    #[derive(Clone, Debug)]
    pub(in crate::scene) struct Organ {
        pub(in crate::scene) kind: OrganKind,
        pub(in crate::scene) mesh: Mesh,
        pub(in crate::scene) uv_scale_mm: [f32; 2],
    }

    pub(in crate::scene) struct Flower {
        pub(in crate::scene) organs: Vec<Organ>,
    }

    pub(in crate::scene) fn grow(d: &RoseDescription) -> crate::Result<Flower> {
        use OrganKind::{Leaf, Petal, Receptacle, Sepal, Stem};
        let kinds = (0..d.petals).map(|_| Petal).chain([Sepal, Receptacle, Stem, Leaf]);
        let organ = |kind| Organ { kind, mesh: super::super::shape::quad(30.0, 40.0), uv_scale_mm: [30.0, 40.0] };
        Ok(Flower { organs: kinds.map(organ).collect() })
    }
}

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
