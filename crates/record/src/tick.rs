//! A recorded tick.

use docktwin_core::{SimTime, Tick};

use crate::column::{Cell, ContactRow};

/// One tick as it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct TickRecord {
    /// Its number.
    pub tick: Tick,
    /// Its time.
    pub time: SimTime,
    /// One cell per column, in the order of [`crate::RunReader::columns`].
    pub row: Vec<Cell>,
    /// The contacts.
    pub contacts: Vec<ContactRow>,
    /// Wall clock when the tick was handed to the recorder, ns since 1970; `None` in recordings that
    /// were not given their start (`started_unix_ns` of the metadata).
    pub recorded_unix_ns: Option<u64>,
}
