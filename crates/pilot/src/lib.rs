//! A person at the controls: the six axes of the chaser from the keyboard, and from a gamepad.
//!
//! Threads read the devices and leave the stick's position in one atomic word; the loop reads it once
//! a tick and waits for nobody. Six axes in one word: a reader never sees half of a change. The stick is
//! a [`Control`] of a run.
//!
//! ```no_run
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use docktwin_pilot::{HOLD_S, Pilot, PilotLimits};
//! use docktwin_run::{Rehearsal, SummaryOnly};
//! use docktwin_scenario::Scenario;
//!
//! let scenario = Scenario::from_path("scenarios/apas_nominal.toml")?;
//! let limits = PilotLimits::of_chaser(&scenario.chaser);
//! // The terminal is the pilot's until `pilot` is dropped.
//! let pilot = Pilot::start(limits, HOLD_S)?;
//! let stick = Some(pilot.stick());
//! Rehearsal::new(&scenario)?.run_with(&mut SummaryOnly, stick, &mut ())?;
//! # Ok(())
//! # }
//! ```

use std::{
    io,
    sync::{
        Arc, Once,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use crossterm::{
    event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers},
    terminal::{disable_raw_mode, enable_raw_mode, is_raw_mode_enabled},
};
use docktwin_core::{DVec3, Wrench};
use docktwin_model::Spacecraft;
use docktwin_physics::reduced::Inputs;
use docktwin_run::{Control, Situation};
use evdev::{AbsoluteAxisCode, Device, EventSummary};

/// What to press, in one line.
pub const PILOT_HELP: &str = "pilot: w/s ±X  a/d ±Y  r/f ±Z   o/u ±roll  i/k ±pitch  j/l ±yaw   space all off   \
     q end (axes of e1; gamepad: triggers X, left stick Y Z, shoulders roll, right stick pitch yaw)";

/// Full stick by default: this acceleration of the chaser, m/s² …
const ACCELERATION_M_S2: f64 = 0.02;
/// … and this angular acceleration about its axis of largest inertia, rad/s².
const ANGULAR_ACCELERATION_RAD_S2: f64 = 0.2 * core::f64::consts::PI / 180.0;
/// Terminals repeat a held key after up to half a second at first.
pub const HOLD_S: f64 = 0.5;
/// Between two looks at the keyboard.
const LOOK: Duration = Duration::from_millis(10);
/// Deflections of a gamepad's stick below this share of its range are rest.
const DEAD_ZONE: f64 = 0.12;

/// Force and moment of a full stick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PilotLimits {
    /// Along each axis of `e1`, N.
    pub force_n: f64,
    /// About each axis of `e1`, N·m.
    pub moment_nm: f64,
}

impl PilotLimits {
    /// 0.02 m/s² of the chaser's mass, and 0.2 °/s² of the largest moment of inertia about an axis
    /// of `e1`.
    #[must_use]
    pub fn of_chaser(chaser: &Spacecraft) -> Self {
        let i = &chaser.inertia_kg_m2;
        let largest = i.x_axis.x.max(i.y_axis.y).max(i.z_axis.z);
        Self {
            force_n: ACCELERATION_M_S2 * chaser.mass_kg,
            moment_nm: ANGULAR_ACCELERATION_RAD_S2 * largest,
        }
    }
}

/// Why nobody can fly.
#[derive(Debug, thiserror::Error)]
pub enum PilotError {
    /// There is no keyboard.
    #[error(
        "a pilot needs a terminal, and there is none: {0}; start docktwin in a terminal (ssh -t, \
         docker run -it)"
    )]
    Terminal(#[source] io::Error),
    /// The thread cannot be started.
    #[error("cannot start the pilot's thread: {0}; close other programs")]
    Thread(#[source] io::Error),
}

/// Six axes, each from −1 to 1: force X Y Z, moment X Y Z.
type Axes = [f64; 6];

/// Largest value of an axis in the word, 10 bits each.
const FULL: f64 = 511.0;

/// Puts the axes into one word.
fn pack(axes: Axes) -> u64 {
    axes.iter().fold(0, |word, a| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 1 and 1023"
        )]
        let level = ((a.clamp(-1.0, 1.0) * FULL).round() + 512.0) as u64;
        word << 10 | level
    })
}

/// Takes the axes out of a word.
fn unpack(word: u64) -> Axes {
    core::array::from_fn(|i| {
        let level = word >> (10 * (5 - i)) & 0x3ff;
        #[expect(clippy::cast_precision_loss, reason = "ten bits")]
        let level = level as f64 - 512.0;
        level / FULL
    })
}

/// What the threads and the loop share.
struct Shared {
    keys: AtomicU64,
    gamepad: AtomicU64,
    ended: AtomicBool,
    /// The loop has ended: the keyboard's thread is to go.
    released: AtomicBool,
}

/// What the loop holds: reads never wait.
#[derive(Clone)]
pub struct Stick {
    shared: Arc<Shared>,
    limits: PilotLimits,
}

impl Stick {
    /// F1, M1 asked for at this moment: on the chaser about its mass centre, in `e1`.
    #[must_use]
    pub fn wrench(&self) -> Wrench {
        let [keys, gamepad] =
            [&self.shared.keys, &self.shared.gamepad].map(|w| unpack(w.load(Ordering::Relaxed)));
        let a: Axes = core::array::from_fn(|i| (keys[i] + gamepad[i]).clamp(-1.0, 1.0));
        Wrench {
            f: DVec3::new(a[0], a[1], a[2]) * self.limits.force_n,
            m: DVec3::new(a[3], a[4], a[5]) * self.limits.moment_nm,
        }
    }

    /// Whether the pilot ended the run, or the keyboard has gone.
    #[must_use]
    pub fn ended(&self) -> bool {
        self.shared.ended.load(Ordering::Relaxed)
    }
}

impl Control for Stick {
    fn wrenches(&mut self, _now: &Situation) -> Inputs {
        Inputs { chaser: self.wrench(), target: Wrench::ZERO }
    }

    /// A pilot may come back.
    fn ahead(&self, _now: &Situation) -> bool {
        true
    }

    fn ended(&self) -> bool {
        Self::ended(self)
    }

    fn in_person(&self) -> bool {
        true
    }
}

/// Whether a pilot of this process has the terminal: then no line of text begins by itself.
#[must_use]
pub fn has_terminal() -> bool {
    is_raw_mode_enabled().unwrap_or(false)
}

/// A keyboard, and a gamepad where there is one, in use. Dropping it gives the terminal back, and so
/// does a panic of any thread.
pub struct Pilot {
    stick: Stick,
    keyboard: Option<JoinHandle<()>>,
    gamepad: Option<String>,
}

/// Gives the terminal back before a panic is told, or its text would be torn.
fn restore_on_panic() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            // Without raw mode this does nothing.
            let _ = disable_raw_mode();
            before(info);
        }));
    });
}

impl Pilot {
    /// Takes the terminal over and starts to read. A key applies its axis for `hold_s` seconds from
    /// its press or its last repetition. Call it before the loop takes its core.
    ///
    /// # Errors
    /// There is no terminal, or no thread can be started.
    pub fn start(limits: PilotLimits, hold_s: f64) -> Result<Self, PilotError> {
        let rest = pack([0.0; 6]);
        let shared = Arc::new(Shared {
            keys: AtomicU64::new(rest),
            gamepad: AtomicU64::new(rest),
            ended: AtomicBool::new(false),
            released: AtomicBool::new(false),
        });
        restore_on_panic();
        enable_raw_mode().map_err(PilotError::Terminal)?;
        let mut pilot = Self { stick: Stick { shared, limits }, keyboard: None, gamepad: None };
        let shared = Arc::clone(&pilot.stick.shared);
        let hold = Duration::from_secs_f64(hold_s.clamp(0.02, 10.0));
        // From here on an early return drops `pilot`, which gives the terminal back.
        let thread = std::thread::Builder::new()
            .name("pilot".to_owned())
            .spawn(move || read_keys(&shared, hold))
            .map_err(PilotError::Thread)?;
        pilot.keyboard = Some(thread);
        pilot.gamepad = start_gamepad(&pilot.stick.shared)?;
        Ok(pilot)
    }

    /// What the loop reads.
    #[must_use]
    pub fn stick(&self) -> Stick {
        self.stick.clone()
    }

    /// Name of the gamepad in use.
    #[must_use]
    pub fn gamepad(&self) -> Option<&str> {
        self.gamepad.as_deref()
    }
}

impl Drop for Pilot {
    fn drop(&mut self) {
        self.stick.shared.released.store(true, Ordering::Relaxed);
        if let Some(t) = self.keyboard.take() {
            // A panic of it was told by the hook.
            let _ = t.join();
        }
        // Nothing can be done for a terminal that has gone.
        let _ = disable_raw_mode();
    }
}

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Key {
    /// Axis and its sign.
    Thrust(usize, f64),
    AllOff,
    End,
}

fn key(k: &KeyEvent) -> Option<Key> {
    if k.kind == KeyEventKind::Release {
        return None;
    }
    let KeyCode::Char(c) = k.code else {
        return (k.code == KeyCode::Esc).then_some(Key::End);
    };
    // In raw mode the terminal no longer makes a signal of it.
    if k.modifiers.contains(KeyModifiers::CONTROL) {
        return (c == 'c').then_some(Key::End);
    }
    Some(match c.to_ascii_lowercase() {
        'w' => Key::Thrust(0, 1.0),
        's' => Key::Thrust(0, -1.0),
        'a' => Key::Thrust(1, 1.0),
        'd' => Key::Thrust(1, -1.0),
        'r' => Key::Thrust(2, 1.0),
        'f' => Key::Thrust(2, -1.0),
        'o' => Key::Thrust(3, 1.0),
        'u' => Key::Thrust(3, -1.0),
        'i' => Key::Thrust(4, 1.0),
        'k' => Key::Thrust(4, -1.0),
        'j' => Key::Thrust(5, 1.0),
        'l' => Key::Thrust(5, -1.0),
        ' ' => Key::AllOff,
        'q' => Key::End,
        _ => return None,
    })
}

/// Axes held by keys, each until its time has passed.
#[derive(Default)]
struct Held {
    axes: [Option<(f64, Instant)>; 6],
}

impl Held {
    /// Takes a key in; true when it ends the run.
    fn press(&mut self, k: Key, now: Instant, hold: Duration) -> bool {
        match k {
            Key::Thrust(axis, sign) => self.axes[axis] = Some((sign, now + hold)),
            Key::AllOff => self.axes = [None; 6],
            Key::End => return true,
        }
        false
    }

    fn axes(&mut self, now: Instant) -> Axes {
        for a in &mut self.axes {
            *a = a.filter(|(_, until)| now < *until);
        }
        self.axes.map(|a| a.map_or(0.0, |(sign, _)| sign))
    }
}

fn read_keys(shared: &Shared, hold: Duration) {
    let mut held = Held::default();
    while !shared.released.load(Ordering::Relaxed) {
        let pressed = event::poll(LOOK)
            .and_then(|there| if there { event::read().map(Some) } else { Ok(None) });
        let now = Instant::now();
        let end = match pressed {
            Ok(Some(Event::Key(k))) => key(&k).is_some_and(|k| held.press(k, now, hold)),
            Ok(_) => false,
            Err(_) => {
                // The terminal has gone, and the pilot with it.
                shared.ended.store(true, Ordering::Relaxed);
                break;
            }
        };
        if end {
            if shared.ended.swap(true, Ordering::Relaxed) {
                // Asked for a second time: the loop does not listen.
                let _ = disable_raw_mode();
                std::process::exit(130);
            }
            held = Held::default();
        }
        shared.keys.store(pack(held.axes(now)), Ordering::Relaxed);
    }
    shared.keys.store(pack([0.0; 6]), Ordering::Relaxed);
}

/// A gamepad with two sticks and analogue triggers, as the kernel's gamepad convention names them.
struct Gamepad {
    device: Device,
    sticks: Sticks,
}

/// Where the sticks, triggers and shoulders of a gamepad stand.
#[derive(Default)]
struct Sticks {
    /// Lowest and highest value of an axis, by its code.
    ranges: Vec<(AbsoluteAxisCode, i32, i32)>,
    axes: Axes,
    triggers: [f64; 2],
    shoulders: [f64; 2],
}

/// Value of a stick between −1 and 1, of a trigger between 0 and 1, by the range of its device.
fn deflection(value: i32, (low, high): (i32, i32), trigger: bool) -> f64 {
    let share = (f64::from(value) - f64::from(low)) / (f64::from(high) - f64::from(low)).max(1.0);
    let x = if trigger { share } else { 2.0 * share - 1.0 };
    // Continuous at the edge of the dead zone.
    let beyond = (x.abs() - DEAD_ZONE).max(0.0) / (1.0 - DEAD_ZONE);
    beyond.min(1.0).copysign(x)
}

impl Gamepad {
    /// The first one there is; its devices must be readable (group `input`).
    fn find() -> Option<Self> {
        let needed = [AbsoluteAxisCode::ABS_X, AbsoluteAxisCode::ABS_Y, AbsoluteAxisCode::ABS_RX];
        evdev::enumerate().map(|(_, device)| device).find_map(|device| {
            let has = |axis| device.supported_absolute_axes().is_some_and(|a| a.contains(axis));
            let buttons =
                device.supported_keys().is_some_and(|k| k.contains(evdev::KeyCode::BTN_SOUTH));
            if !buttons || !needed.into_iter().all(has) {
                return None;
            }
            let ranges =
                device.get_absinfo().ok()?.map(|(a, i)| (a, i.minimum(), i.maximum())).collect();
            Some(Self { device, sticks: Sticks { ranges, ..Sticks::default() } })
        })
    }

    fn read(mut self, shared: &Shared) {
        loop {
            // One that was unplugged pushes no more.
            let Ok(events) = self.device.fetch_events() else {
                return shared.gamepad.store(pack([0.0; 6]), Ordering::Relaxed);
            };
            events.for_each(|e| self.sticks.take(e.destructure()));
            shared.gamepad.store(pack(self.sticks.axes), Ordering::Relaxed);
        }
    }
}

impl Sticks {
    /// Takes an event in. Sticks forward and to the left are positive: +Z, +Y, +pitch, +yaw.
    fn take(&mut self, event: EventSummary) {
        match event {
            EventSummary::AbsoluteAxis(_, axis, value) => {
                let range = self.ranges.iter().find(|r| r.0 == axis).map(|r| (r.1, r.2));
                let Some(range) = range else { return };
                let x = |trigger| deflection(value, range, trigger);
                match axis {
                    AbsoluteAxisCode::ABS_X => self.axes[1] = -x(false),
                    AbsoluteAxisCode::ABS_Y => self.axes[2] = -x(false),
                    AbsoluteAxisCode::ABS_RY => self.axes[4] = -x(false),
                    AbsoluteAxisCode::ABS_RX => self.axes[5] = -x(false),
                    AbsoluteAxisCode::ABS_Z => self.triggers[0] = x(true),
                    AbsoluteAxisCode::ABS_RZ => self.triggers[1] = x(true),
                    _ => {}
                }
            }
            EventSummary::Key(_, evdev::KeyCode::BTN_TL, down) => {
                self.shoulders[0] = f64::from(down.min(1));
            }
            EventSummary::Key(_, evdev::KeyCode::BTN_TR, down) => {
                self.shoulders[1] = f64::from(down.min(1));
            }
            _ => {}
        }
        self.axes[0] = self.triggers[1] - self.triggers[0];
        self.axes[3] = self.shoulders[1] - self.shoulders[0];
    }
}

/// Starts to read the gamepad, if there is one, and gives its name. Its thread waits in the kernel and
/// ends with the process.
fn start_gamepad(shared: &Arc<Shared>) -> Result<Option<String>, PilotError> {
    let Some(gamepad) = Gamepad::find() else { return Ok(None) };
    let name = gamepad.device.name().unwrap_or("a gamepad without a name").to_owned();
    let shared = Arc::clone(shared);
    std::thread::Builder::new()
        .name("gamepad".to_owned())
        .spawn(move || gamepad.read(&shared))
        .map_err(PilotError::Thread)?;
    Ok(Some(name))
}

#[cfg(test)]
mod tests {
    #![expect(clippy::float_cmp, reason = "full and rest are exact")]

    use super::*;

    #[test]
    fn oracle_one_word_holds_six_axes() {
        for axes in [[0.0; 6], [1.0, -1.0, 1.0, -1.0, 1.0, -1.0], [-1.0; 6], [1.0; 6]] {
            assert_eq!(unpack(pack(axes)), axes);
        }
        let mixed = [0.1, -0.2, 0.3, -0.4, 0.5, -0.6];
        for (a, b) in unpack(pack(mixed)).iter().zip(mixed) {
            assert!((a - b).abs() <= 0.5 / FULL, "{a} for {b}");
        }
        // Beyond its range an axis is full, not another one's.
        assert_eq!(unpack(pack([7.0, 0.0, 0.0, 0.0, 0.0, -7.0])), [1.0, 0.0, 0.0, 0.0, 0.0, -1.0]);
    }

    #[test]
    fn oracle_a_key_holds_until_its_time_has_passed_and_repetition_renews_it() {
        let (begin, hold) = (Instant::now(), Duration::from_millis(500));
        let at = |ms| begin + Duration::from_millis(ms);
        let mut held = Held::default();
        let w = key(&KeyEvent::from(KeyCode::Char('w'))).expect("a key of ours");
        let d = key(&KeyEvent::from(KeyCode::Char('d'))).expect("a key of ours");
        assert!(!held.press(w, at(0), hold));
        assert_eq!(held.axes(at(499)), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        held.press(w, at(490), hold);
        held.press(d, at(700), hold);
        assert_eq!(held.axes(at(989)), [1.0, -1.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(held.axes(at(990)), [0.0, -1.0, 0.0, 0.0, 0.0, 0.0]);
        held.press(Key::AllOff, at(991), hold);
        assert_eq!(held.axes(at(991)), [0.0; 6]);
    }

    #[test]
    fn invariant_every_axis_has_both_signs_on_the_keyboard() {
        let mut seen = Vec::new();
        for c in ' '..='~' {
            if let Some(Key::Thrust(axis, sign)) = key(&KeyEvent::from(KeyCode::Char(c))) {
                seen.push((axis, sign > 0.0, c.to_ascii_lowercase()));
                assert!(PILOT_HELP.contains(c.to_ascii_lowercase()), "{c} is not in the help");
            }
        }
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 12, "{seen:?}");
        let c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(key(&c), Some(Key::End));
        assert_eq!(key(&KeyEvent::from(KeyCode::Char('q'))), Some(Key::End));
    }

    #[test]
    fn oracle_a_gamepad_moves_the_axes_that_the_help_names() {
        use evdev::{EventType, InputEvent};
        let stick = |axis| (axis, -32768, 32767);
        let mut pad = Sticks {
            ranges: vec![
                stick(AbsoluteAxisCode::ABS_X),
                stick(AbsoluteAxisCode::ABS_Y),
                stick(AbsoluteAxisCode::ABS_RX),
                stick(AbsoluteAxisCode::ABS_RY),
                (AbsoluteAxisCode::ABS_Z, 0, 255),
                (AbsoluteAxisCode::ABS_RZ, 0, 255),
            ],
            ..Sticks::default()
        };
        let mut push = |kind: EventType, code: u16, value| {
            pad.take(InputEvent::new(kind.0, code, value).destructure());
            pad.axes.map(f64::round)
        };
        // The kernel counts to the right and down.
        let (axis, key) = (EventType::ABSOLUTE, EventType::KEY);
        assert_eq!(push(axis, AbsoluteAxisCode::ABS_X.0, -32768), [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(push(axis, AbsoluteAxisCode::ABS_Y.0, 32767), [0.0, 1.0, -1.0, 0.0, 0.0, 0.0]);
        assert_eq!(push(axis, AbsoluteAxisCode::ABS_RZ.0, 255)[0], 1.0);
        assert_eq!(push(axis, AbsoluteAxisCode::ABS_Z.0, 255)[0], 0.0);
        assert_eq!(push(key, evdev::KeyCode::BTN_TR.0, 1)[3], 1.0);
        assert_eq!(push(key, evdev::KeyCode::BTN_TR.0, 0)[3], 0.0);
        assert_eq!(push(axis, AbsoluteAxisCode::ABS_RY.0, -32768)[4], 1.0);
        assert_eq!(push(axis, AbsoluteAxisCode::ABS_RX.0, 32767)[5], -1.0);
        // An axis that the device did not announce.
        assert_eq!(push(axis, AbsoluteAxisCode::ABS_HAT0X.0, 1)[5], -1.0);
    }

    #[test]
    fn oracle_a_stick_at_rest_pushes_nothing_and_at_its_end_everything() {
        let range = (-32768, 32767);
        assert_eq!(deflection(-32768, range, false), -1.0);
        assert_eq!(deflection(32767, range, false), 1.0);
        assert_eq!(deflection(2000, range, false).abs(), 0.0);
        assert_eq!(deflection(0, (0, 255), true), 0.0);
        assert_eq!(deflection(255, (0, 255), true), 1.0);
        assert_eq!(deflection(128, (0, 255), false).abs(), 0.0);
    }
}
