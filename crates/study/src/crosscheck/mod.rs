//! A docking in a second engine, MuJoCo, which shares no code with docktwin, and the comparison.
//!
//! [`SecondEngine`] runs a recorded run once more; [`record`] makes a run directory of its tables;
//! [`compare`] holds both recordings against the requirements. Making and recording docktwin's own run
//! is the caller's part.

mod comparison;
mod second;
mod tables;

pub use self::{
    comparison::{
        ANGLE_RAD, Compared, ComparisonSummary, CrossCheck, PEAK_FORCE, POSITION_M, Passes,
        PoseDifference, Side, Until, compare,
    },
    second::{EngineError, EngineResult, EngineRun, SecondEngine, engine_summary},
    tables::record,
};
