use serde::{Deserialize, Serialize};
use serde_json::Value;

use docktwin_core::{SimTime, Tick};

/// Something that happened: a line of `events.jsonl` and a message on `/events`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// When, as a tick.
    pub tick: u64,
    /// When, s of simulated time.
    pub time_s: f64,
    /// What, as a stable word: `contact_begin`, `contact_end`, `latch_approach`, `latch_strike`,
    /// `latched`, `captured`, `limit`, `thrust_on`, `outcome` …
    pub kind: String,
    /// One sentence for a reader.
    pub text: String,
    /// The particulars, with the unit in every key.
    #[serde(default)]
    pub body: Value,
}

impl Event {
    /// An event at a tick.
    #[must_use]
    pub fn new(
        tick: Tick,
        time: SimTime,
        kind: impl Into<String>,
        text: impl Into<String>,
        body: Value,
    ) -> Self {
        Self { tick: tick.0, time_s: time.seconds(), kind: kind.into(), text: text.into(), body }
    }

    /// One line of JSON with its line feed.
    pub(crate) fn to_line(&self) -> String {
        // A string, integers and a JSON value always serialise; the fallback keeps the tick.
        let mut line = serde_json::to_string(self)
            .unwrap_or_else(|_| format!("{{\"tick\":{},\"time_s\":null}}", self.tick));
        line.push('\n');
        line
    }
}
