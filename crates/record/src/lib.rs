//! Recording and reading a run: the crash-safe MCAP log, the Parquet table, events and the summary.
//!
//! A run directory holds
//!
//! | file | written by | content |
//! | --- | --- | --- |
//! | `run.mcap` | [`RunWriter`] | every tick: columns, contacts, events, and their chained digests; readable after a crash |
//! | `telemetry.parquet` | [`RunWriter`] | the same columns, one row a tick; complete only after `finish` |
//! | `events.jsonl` | [`RunWriter`] | one [`Event`] a line |
//! | `scenario.toml` | [`RunWriter::scenario_toml`] | the scenario as it ran |
//! | `summary.json` | [`RunWriter::finish`] | [`Summary`] |
//!
//! Rows, events, the summary and the files kept with a run have digests ([`RunReader::cut`] tells what does not
//! fit, [`Flaw`] of which kind it is): rows that do not fit theirs are not handed out.
//!
//! Every number is kept bit for bit, NaN payloads and −0.0 included, so that a replay can be
//! compared with its recording tick by tick ([`first_difference`]).
//!
//! In `run.mcap` each topic is one channel in the ROS 2 wire format (`cdr`, schema `ros2msg`), so
//! that Foxglove, PlotJuggler and the public `mcap` tools decode it without docktwin.
//!
//! ```
//! use std::collections::BTreeMap;
//!
//! use docktwin_core::{SimTime, Tick};
//! use docktwin_record::{Cell, Column, Policy, RunReader, RunWriter};
//!
//! # let dir = tempfile::tempdir().unwrap();
//! # let dir = dir.path().join("run");
//! let columns = vec![Column::f64("/loads", "force_x_n"), Column::u64("/latches", "phase")];
//! let mut run = RunWriter::create(&dir, columns, Vec::new(), &BTreeMap::new(), Policy::Wait)?;
//! for n in 0..3u32 {
//!     let row = [Cell::from(f64::from(n) * 100.0), Cell::from(u64::from(n))];
//!     run.tick(Tick(n.into()), SimTime::of_tick(Tick(n.into()), 1_000_000), &row, &[])?;
//! }
//! drop(run); // as if the process had been killed: no summary, no index
//!
//! let mut log = RunReader::open(&dir)?;
//! let force = log.column_index("force_x_n").expect("a column");
//! let ticks: Result<Vec<_>, _> = log.ticks().collect();
//! assert_eq!(ticks?[2].row[force].as_f64(), 200.0);
//! # Ok::<(), docktwin_record::RecordError>(())
//! ```
//!
//! Absent on purpose: physics, scenarios, the loop. This crate knows names, units and bits.

#![cfg_attr(test, expect(clippy::unwrap_used, reason = "a test stops at the first surprise"))]

mod assembly;
mod bounded;
mod chain;
mod check;
mod column;
mod compare;
mod container;
mod diff;
mod error;
mod event;
mod export;
mod flaw;
mod import;
mod keys;
mod layout;
mod log;
mod paths;
mod reader;
mod recover;
mod scan;
mod summary;
mod table;
mod table_check;
mod tick;
mod writer;

use std::collections::BTreeMap;

pub use check::{KEPT_KEY, SummaryFile, read_summary};
pub use column::{Cell, Column, ColumnKind, ColumnProblem, ContactRow};
pub use compare::{
    Align, ColumnComparison, CompareOptions, Comparison, StateComparison, Tolerance, compare,
    unit_of,
};
pub use diff::{Difference, first_difference, first_difference_except};
pub use error::RecordError;
pub use event::Event;
pub use export::{Exported, Selection, WRITE_EXPORT, export_csv, export_mat};
pub use flaw::{Cut, Flaw, Hole};
pub use import::read_table;
#[doc(hidden)]
pub use reader::flip_bit;
pub use reader::{RunReader, Ticks, rebuild_parquet};
pub use recover::{Recovered, recover};
pub use summary::{
    CompensatorSummary, Fidelity, FidelityFigures, FidelityOf, LatenessUs, LoopSummary, Masses,
    Outcome, PhaseUs, RecordingSummary, SUMMARY_SCHEMA, SafetySummary, StepUs, Summary, Verdict,
};
pub use tick::TickRecord;
pub use writer::{Policy, RunWriter};

/// Version of the layout of `run.mcap`; a reader refuses a newer one.
pub const RECORD_SCHEMA: u32 = 1;

/// Whether a run with this metadata repeats bit by bit: not what kept real time, nor what ran against a rig
/// in another process. What says nothing of either was rehearsed.
#[must_use]
pub fn repeats(metadata: &BTreeMap<String, String>) -> bool {
    let is = |key: &str, repeating: &str| metadata.get(key).is_none_or(|x| x == repeating);
    is("clock", "virtual") && is("rig", "emulated")
}

/// File names in a run directory.
pub mod files {
    /// The crash-safe log.
    pub const LOG: &str = "run.mcap";
    /// The columns as a table.
    pub const TABLE: &str = "telemetry.parquet";
    /// Events, one JSON object a line.
    pub const EVENTS: &str = "events.jsonl";
    /// The scenario as it ran.
    pub const SCENARIO: &str = "scenario.toml";
    /// The result.
    pub const SUMMARY: &str = "summary.json";
}
