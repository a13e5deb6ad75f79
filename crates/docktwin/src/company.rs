//! A live viewer and a pilot, as the command line asks for them.

use std::time::Duration;

use clap::Args;
use docktwin::{
    live::{Live, LiveReport},
    pilot::{HOLD_S, PILOT_HELP, Pilot, PilotLimits, Stick},
};
use docktwin_core::{SimTime, Tick};
use docktwin_record::{Column, Event, Summary};
use docktwin_run::{
    Sink, SinkError,
    sink::{Header, TickView},
};
use docktwin_scenario::Scenario;

use crate::{args::not_negative, failure::Failure};

/// How long a viewer may take over what is left when the run has ended.
const LIVE_PATIENCE: Duration = Duration::from_secs(10);

/// A viewer that looks on.
#[derive(Debug, Default, Args)]
pub(crate) struct LiveArgs {
    /// Show the run in a viewer that is open, while it happens
    #[arg(
        long,
        value_name = "URL",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = docktwin_view::LIVE_URL
    )]
    pub(crate) live: Option<String>,
}

impl LiveArgs {
    /// Finds the viewer. Call it before anything is written, and before a loop takes its core.
    pub(crate) fn start(
        &self,
        scenario: &Scenario,
        columns: &[Column],
    ) -> Result<Option<LiveViewer>, Failure> {
        let live = self.live.as_deref().map(|url| Live::start(url, scenario, columns));
        Ok(live.transpose()?.map(|live| LiveViewer {
            live: Some(live),
            report: None,
            tick_nanos: 0,
        }))
    }
}

/// A person at the controls.
#[derive(Debug, Args)]
pub(crate) struct PilotArgs {
    /// Fly the chaser from the keyboard of this terminal, and from a gamepad, in real time
    #[arg(long)]
    pilot: bool,
    /// Force of a full stick along each axis of e1, N [default: 0.02 m/s² of the chaser's mass]
    #[arg(long = "pilot-force", value_name = "N", requires = "pilot", value_parser = not_negative)]
    force_n: Option<f64>,
    /// Moment of a full stick about each axis, N·m [default: 0.2 °/s² of its largest inertia]
    #[arg(long = "pilot-moment", value_name = "NM", requires = "pilot", value_parser = not_negative)]
    moment_nm: Option<f64>,
    /// How long a key stroke pushes, s; a key held down repeats, in most terminals after 0.5 s
    #[arg(
        long = "pilot-hold",
        value_name = "S",
        requires = "pilot",
        default_value_t = HOLD_S,
        value_parser = not_negative
    )]
    hold_s: f64,
}

impl Default for PilotArgs {
    fn default() -> Self {
        Self { pilot: false, force_n: None, moment_nm: None, hold_s: HOLD_S }
    }
}

impl PilotArgs {
    /// Hands the terminal to the pilot, whose it is until what is given is dropped.
    pub(crate) fn start(&self, scenario: &Scenario) -> Result<Option<AtControls>, Failure> {
        if !self.pilot {
            return Ok(None);
        }
        let own = PilotLimits::of_chaser(&scenario.chaser);
        let limits = PilotLimits {
            force_n: self.force_n.unwrap_or(own.force_n),
            moment_nm: self.moment_nm.unwrap_or(own.moment_nm),
        };
        eprintln!("{PILOT_HELP}");
        Ok(Some(AtControls(Some(Pilot::start(limits, self.hold_s)?))))
    }
}

/// A pilot who has the terminal.
pub(crate) struct AtControls(Option<Pilot>);

impl AtControls {
    /// The stick.
    pub(crate) fn stick(&self) -> Option<Stick> {
        self.0.as_ref().map(Pilot::stick)
    }
}

impl Drop for AtControls {
    fn drop(&mut self) {
        // The terminal is given back before the line is ended.
        drop(self.0.take());
        eprintln!();
    }
}

/// A live viewer that takes what a run gives.
pub(crate) struct LiveViewer {
    live: Option<Live>,
    report: Option<LiveReport>,
    tick_nanos: u64,
}

impl LiveViewer {
    /// What became of the stream, once the run has ended.
    pub(crate) fn report(&self) {
        let Some(LiveReport { sent, dropped, events_dropped, complete }) = self.report else {
            return;
        };
        if complete {
            eprintln!(
                "live viewer: {sent} ticks shown, {dropped} ticks and {events_dropped} events left out"
            );
        } else {
            eprintln!(
                "live viewer: it went away or did not keep up; {sent} ticks sent, {dropped} left out"
            );
        }
    }
}

impl Sink for LiveViewer {
    fn begin(&mut self, h: &Header<'_>) -> Result<(), SinkError> {
        self.tick_nanos = h.scenario.run.tick_nanos;
        Ok(())
    }

    fn event(&mut self, e: &Event) -> Result<(), SinkError> {
        if let Some(live) = &self.live {
            let time = SimTime::of_tick(Tick(e.tick), self.tick_nanos);
            live.events().event(time, &e.kind, &e.text);
        }
        Ok(())
    }

    fn tick(&mut self, t: &TickView<'_>) -> Result<(), SinkError> {
        if let Some(live) = &mut self.live {
            live.tick(t.time, t.row, t.contacts, t.due);
        }
        Ok(())
    }

    fn finish(&mut self, _summary: &mut Summary) -> Result<(), SinkError> {
        self.report = self.live.take().map(|live| live.finish(LIVE_PATIENCE));
        Ok(())
    }
}
