//! The cores of the guiding surfaces: a ring is its centre circle swept by a ball, a petal a ruled
//! sheet swept by a ball. Cores are exact; there is no tessellation.

mod circle;
mod sheet;

pub(crate) use circle::Circle;
pub(crate) use sheet::{
    Jet, Patch, PatchAbout, Sheet, nearest_on_pieces, off_axis, root_derivatives,
};
