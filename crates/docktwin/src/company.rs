//! A live viewer and a pilot, as the command line asks for them.

use clap::Args;
use docktwin_pilot::{HOLD_S, PILOT_HELP, Pilot, PilotLimits, Stick};
use docktwin_playback::{LiveReport, LiveViewer};
use docktwin_record::Column;
use docktwin_scenario::Scenario;

use crate::{args::not_negative, failure::Failure};

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
        let live = self.live.as_deref().map(|url| LiveViewer::start(url, scenario, columns));
        Ok(live.transpose()?)
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

/// Says what became of a live stream, once the run has ended.
pub(crate) fn tell_live(viewer: &LiveViewer) {
    let Some(LiveReport { sent, dropped, events_dropped, complete }) = viewer.report() else {
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
