//! Who is there while a run happens: a live viewer, and a pilot.

use core::fmt;
use std::{io::Write as _, time::Duration};

use clap::Args;
use docktwin::{
    live::{Live, LiveReport},
    pilot::{HOLD_S, PILOT_HELP, Pilot, PilotLimits, Stick},
};
use docktwin_core::{Euler, Pose, Wrench};
use docktwin_record::Column;
use docktwin_scenario::Scenario;

use crate::{cli::not_negative, failure::Failure};

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

/// Who is there while it happens.
#[derive(Default)]
pub(crate) struct Company {
    live: Option<Live>,
    pilot: Option<Pilot>,
}

impl Company {
    /// Finds the viewer and hands the terminal to the pilot, whose it is until [`Company::land`].
    /// Call it before anything is written, and before a loop takes its core.
    pub(crate) fn invite(
        live: &LiveArgs,
        pilot: &PilotArgs,
        scenario: &Scenario,
        columns: &[Column],
    ) -> Result<Self, Failure> {
        let live = live.live.as_deref().map(|url| Live::start(url, scenario, columns));
        let live = live.transpose()?;
        // Last: from here on the terminal is the pilot's.
        let pilot = pilot.pilot.then(|| {
            let own = PilotLimits::of_chaser(&scenario.chaser);
            let limits = PilotLimits {
                force_n: pilot.force_n.unwrap_or(own.force_n),
                moment_nm: pilot.moment_nm.unwrap_or(own.moment_nm),
            };
            eprintln!("{PILOT_HELP}");
            Pilot::start(limits, pilot.hold_s)
        });
        Ok(Self { live, pilot: pilot.transpose()? })
    }

    /// The pilot's stick.
    pub(crate) fn stick(&self) -> Option<Stick> {
        self.pilot.as_ref().map(Pilot::stick)
    }

    /// What shows the run.
    pub(crate) const fn live(&mut self) -> Option<&mut Live> {
        self.live.as_mut()
    }

    /// Gives the terminal back, before anything is printed.
    pub(crate) fn land(&mut self) {
        if let Some(pilot) = self.pilot.take() {
            drop(pilot);
            eprintln!();
        }
    }

    /// Ends the stream to the viewer, and says what became of it.
    pub(crate) fn part(&mut self, json: bool) {
        if let Some(live) = self.live.take() {
            let report = live.finish(LIVE_PATIENCE);
            if !json {
                tell(&report);
            }
        }
    }
}

fn tell(report: &LiveReport) {
    let LiveReport { sent, dropped, events_dropped, complete } = report;
    if *complete {
        eprintln!(
            "live viewer: {sent} ticks shown, {dropped} ticks and {events_dropped} events left out"
        );
    } else {
        eprintln!(
            "live viewer: it went away or did not keep up; {sent} ticks sent, {dropped} left out"
        );
    }
}

/// What a pilot without a window flies by.
pub(crate) struct Flight<'a> {
    /// The docking ports.
    pub(crate) x_34: &'a Pose,
    /// How fast they come together, m/s.
    pub(crate) closing_m_s: f64,
    /// Force between them, N.
    pub(crate) contact_n: f64,
    /// F1, M1 in `e1`.
    pub(crate) control: &'a Wrench,
}

impl fmt::Display for Flight<'_> {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (p, e) = (self.x_34.p, Euler::from_quat(self.x_34.q));
        let Wrench { f, m } = self.control;
        write!(
            to,
            "x {:+.3} y {:+.3} z {:+.3} m  closing {:+.3} m/s  roll {:+.2} pitch {:+.2} yaw {:+.2} °  \
             contact {:.0} N  F1 {:+.0} {:+.0} {:+.0} N  M1 {:+.0} {:+.0} {:+.0} N·m",
            p.x,
            p.y,
            p.z,
            self.closing_m_s,
            e.roll.to_degrees(),
            e.pitch.to_degrees(),
            e.yaw.to_degrees(),
            self.contact_n,
            f.x,
            f.y,
            f.z,
            m.x,
            m.y,
            m.z,
        )
    }
}

/// Says it to the pilot, in one line that replaces itself. Not on a loop's own path.
pub(crate) fn pilot_line(when: fmt::Arguments<'_>, flight: &Flight<'_>) {
    // A terminal that has gone ends the run by its keyboard.
    let _ = std::io::stderr().write_all(format!("\r{when}  {flight}\x1b[K").as_bytes());
}
