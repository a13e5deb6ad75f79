//! One tick of a running loop.

use docktwin_control::{
    compensation::{Compensator, Gained, LATCHES, Measured, Report, Target},
    feedforward::PlateMotion,
    safety::{Trip, Watched, half_widths},
    sensing::{Readings, SensorScheme},
};
use docktwin_core::{DVec3, Digest, Pose, StateHasher, Twist};
use docktwin_physics::{
    body::BodyState,
    mounted::{Carried, Ports},
    platform::Platform,
    programme::RelativeMotion,
    reduced::Inputs,
};
use docktwin_rigport::{
    clock::monotonic_ns,
    message::{Capabilities, RigCommand, RigMeasurement, RigMode, Status, wrench},
    rig::{Rig, RigError},
};

use super::{ACCELERATIONS, IN_FLIGHT, Loop, Phase, Running};
use crate::{
    clock::Clock,
    commands::{Motion, guard, largest, least, write_motion},
};

// Both ends of the port have room for as many.
const _: () = assert!(LATCHES == docktwin_rigport::message::LATCHES);

/// Parts of a tick whose times are kept, in this order.
pub const PHASES: [&str; 6] = ["receive", "condition", "bodies", "command", "safety", "send"];

/// Time over which the measured wrenches come in after closing, s.
const CLOSING_S: f64 = 0.02;
/// Leg speed that counts as rest, m/s; length sensors show some of their own.
const REST_M_S: f64 = 0.005;

/// One tick as it was, for the record. Plain and large; it is written once and copied once.
#[derive(Clone, Copy, Debug)]
pub struct TickRecord {
    /// Tick since the start of the loop.
    pub tick: u64,
    /// Tick of the closed loop, 0 when it is closed; `None` outside.
    pub closed_tick: Option<u64>,
    /// Where the run is.
    pub phase: Phase,
    /// How late the wake-up was, ns.
    pub lateness_ns: u64,
    /// Ticks left out before this one.
    pub missed: u64,
    /// Computing time of this tick, ns.
    pub compute_ns: u64,
    /// The measurement of `t_k`, or the last one there was.
    pub measurement: RigMeasurement,
    /// Whether it is of this tick.
    pub fresh: bool,
    /// Measured `X_34`.
    pub x_34: Pose,
    /// Conditioned wrenches at the ports.
    pub ports: Ports,
    /// What was added to them for the bodies: by the compensator, where it corrects wrenches, and by the damping of a
    /// budget of energy.
    pub correction: Option<Ports>,
    /// The bodies at `t_k`; at the initial condition before the loop is closed.
    pub bodies: [BodyState; 2],
    /// Control wrenches held from `t_k`.
    pub control: Inputs,
    /// Motion of the bodies (of the plan before closing) at `t_{k+1}`.
    pub motion: RelativeMotion,
    /// What was sent.
    pub command: RigCommand,
    /// Digest of the compensator's own state, where it has any.
    pub compensator_digest: Option<u64>,
    /// What the compensator says of its model, where it has one.
    pub compensator_report: Option<Report>,
    /// The loop's energy, where it has a budget.
    pub gained: Option<Gained>,
    /// The limit that was passed, from its tick on.
    pub trip: Option<Trip>,
}

impl TickRecord {
    /// Digest of the bodies, of the rig as far as it reports one, of the control wrenches, and of the
    /// compensator's state. Not for the loop's own path.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let mut h = StateHasher::new();
        self.bodies.iter().for_each(|b| b.hash_into(&mut h));
        h.u64(self.measurement.state_digest);
        self.control.hash_into(&mut h);
        if let Some(digest) = self.compensator_digest {
            h.u64(digest);
        }
        h.finish()
    }
}

/// Readings of one instant.
pub(super) fn readings(m: &RigMeasurement) -> Readings {
    let (a, b) = (wrench(&m.sensor_a), wrench(&m.sensor_b));
    Readings { a, b, ring: m.ring().map_or(DVec3::ZERO, |[d, _]| d) }
}

/// A motion command, and its values that the supervisor checks.
struct Commanded {
    message: RigCommand,
    /// Lengths and speeds of the legs as the rig's file has them, whether or not the rig is driven
    /// by them.
    legs: Option<[[f64; 6]; 2]>,
}

impl<R: Rig, K: Clock, C: Compensator> Loop<R, K, Running, C> {
    /// Where the run is.
    pub const fn phase(&self) -> Phase {
        self.state.phase
    }

    /// One tick: waits for it, and goes through everything. `control` are the control wrenches of the
    /// tick; they count once the loop is closed.
    ///
    /// # Errors
    /// The connection to the rig is broken. The loop stops by itself when measurements stay away.
    pub fn tick(&mut self, control: &Inputs) -> Result<TickRecord, RigError> {
        let w = self.clock.wait();
        // Ticks left out are ticks of the rig.
        self.tick += w.missed;
        let mut mark = monotonic_ns();
        let begin = mark;
        let mut lap = [0; PHASES.len()];
        let mut timed = |i: usize| {
            let now = monotonic_ns();
            lap[i] = now - mark;
            mark = now;
        };

        let fresh = self.receive(w.due_ns)?;
        timed(0);

        let ports = self.condition(fresh);
        let correction = self.correct(w.tick, control);
        timed(1);

        let bodies = self.state.bodies.bodies();
        let closed_tick = (self.state.phase == Phase::Closed).then_some(self.state.closed);
        let (phase, x_34) = (self.state.phase, self.state.measured.x_34);
        let motion = self.advance(correction.as_ref(), control);
        timed(2);

        let mut commanded = self.command(w.tick, w.due_ns, &motion, control);
        self.state.motion = motion;
        timed(3);

        let trip = self.judge(&commanded);
        if trip.is_some() {
            self.enter_stop();
        }
        if self.state.phase == Phase::Stop {
            commanded.message = self.still(RigMode::Stop, w.due_ns);
        }
        let mut command = commanded.message;
        self.state.guard.write(&mut command);
        timed(4);

        self.rig.send(&command)?;
        self.tick += 1;
        timed(5);
        let compute_ns = mark - begin;
        self.times.lateness.record_ns(w.lateness_ns);
        self.times.compute.record_ns(compute_ns);
        for (i, ns) in lap.into_iter().enumerate() {
            self.times.phases.record_ns(i, ns);
        }
        Ok(TickRecord {
            tick: w.tick,
            closed_tick,
            phase,
            lateness_ns: w.lateness_ns,
            missed: w.missed,
            compute_ns,
            measurement: self.state.last,
            fresh,
            x_34,
            ports,
            correction,
            bodies,
            control: *control,
            motion,
            command,
            compensator_digest: self.compensator.digest(),
            compensator_report: self.compensator.report(),
            gained: self.setup.limits.energy_gained.map(|_| self.state.gained),
            trip,
        })
    }

    /// Takes what the rig has measured; true when it is of this tick and can be used.
    fn receive(&mut self, due_ns: u64) -> Result<bool, RigError> {
        let received = self.rig.receive(self.setup.patience, self.clock.now_ns());
        self.state.gone = received == Err(RigError::Gone);
        let fresh = match received {
            Ok(Some(m)) => self.take(&m, due_ns),
            Ok(None) | Err(RigError::Gone) => false,
            Err(RigError::Refused(_)) => {
                self.times.refused += 1;
                false
            }
            Err(e) => return Err(e),
        };
        let s = &mut self.state;
        s.measured.fresh = fresh;
        let speeds = s.measured.leg_speed_m_s;
        let rests = fresh && speeds.is_some_and(|v| largest(&v) < REST_M_S);
        s.resting = if rests { s.resting + 1 } else { 0 };
        if fresh {
            s.without = 0;
        } else {
            s.without += 1;
            self.times.without += 1;
        }
        Ok(fresh)
    }

    /// Stores a measurement and computes the pose of the plate from it. False when its lengths
    /// belong to no pose, or when a required sensor is missing: then the supervisor still checks
    /// it, but the bodies do not use it.
    fn take(&mut self, m: &RigMeasurement, due_ns: u64) -> bool {
        use Capabilities as C;
        let two = self.setup.scheme == SensorScheme::Two;
        let s = &mut self.state;
        if let (Some(past), Some(new)) = (&mut s.accelerations, m.accelerometer()) {
            past.rotate_right(1);
            past[0] = new;
        }
        let same = [
            m.has(C::SENSOR_A) && same_bits(&m.sensor_a, &s.last.sensor_a),
            m.has(C::SENSOR_B) && same_bits(&m.sensor_b, &s.last.sensor_b),
            two && s.accelerations.is_some()
                && same_bits(&m.plate_acceleration, &s.last.plate_acceleration),
        ];
        for (ticks, same) in s.frozen.iter_mut().zip(same) {
            *ticks = if same { *ticks + 1 } else { 0 };
        }
        s.last = *m;
        let found = if m.has(C::LEG_LENGTH) {
            self.platform.forward(&m.leg_length_m, &s.measured.x_bp).ok().map(|f| f.x_bp)
        } else {
            m.plate()
        };
        let x_bp = found.unwrap_or(s.measured.x_bp);
        s.measured = measured(m, &self.platform, &x_bp);
        #[expect(clippy::cast_precision_loss, reason = "ages are far below 2^53 ns")]
        let age_ns = due_ns as f64 - m.stamp_ns as f64;
        s.measured.age_s = age_ns * 1e-9;
        found.is_some() && !self.sensors_gone()
    }

    /// Motion of sensor B at the instant of its reading: as measured by the accelerometers, or as
    /// commanded if there are none.
    fn carried(&self) -> Carried {
        let commanded = self.carried_as_commanded();
        let Some(read) = &self.state.accelerations else { return commanded };
        // A reading that lags behind that of B is extrapolated.
        let back = (self.setup.parameters.accelerometers_ahead_s / self.period_s())
            .clamp(-1.0, (ACCELERATIONS - 1) as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 2")]
        let whole = (back.max(0.0) as usize).min(ACCELERATIONS - 2);
        let part = back - whole as f64;
        let at = |i: usize| read[whole][i] * (1.0 - part) + read[whole + 1][i] * part;
        Carried::felt(at(0), at(1), commanded.rate)
    }

    /// The plate as commanded, when it should be where it is measured now.
    fn carried_as_commanded(&self) -> Carried {
        // The newest command is of the present instant; the plate is where it was commanded this much
        // earlier.
        let s = &self.state;
        let t = self.period_s();
        let back = (self.setup.parameters.interface_delay_s / t).clamp(0.0, (IN_FLIGHT - 2) as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 30")]
        let whole = back as usize;
        let part = back - back.floor();
        let (new, old) = (&s.in_flight[whole], &s.in_flight[whole + 1]);
        let mix = |a: DVec3, b: DVec3| a * (1.0 - part) + b * part;
        let acceleration = Twist {
            v: mix(new.acceleration.v, old.acceleration.v),
            w: mix(new.acceleration.w, old.acceleration.w),
        };
        let rig = &self.setup.rig;
        let twist = Twist { v: new.twist.v, w: mix(new.twist.w, old.twist.w) };
        let x_p4 = rig.x_4p.inverse();
        Carried::on_plate(&s.measured.x_bp, &x_p4, rig.gravity_m_s2, &twist, &acceleration)
    }

    /// The wrenches at both ports: of this measurement, or the last ones there were.
    fn condition(&mut self, fresh: bool) -> Ports {
        if fresh {
            let carried = self.carried();
            let read = readings(&self.state.last);
            let half = self.ticks(0.5 * self.setup.approach.settle_s);
            let s = &mut self.state;
            if s.phase == Phase::Settle && s.since >= half {
                s.conditioning.tare_sample(&read, &carried);
            }
            s.ports = s.conditioning.ports(&read, &s.measured.x_34, &carried);
        }
        self.state.ports
    }

    /// What the compensator, and beyond half of a budget of energy its damping, add to the wrenches for the bodies.
    fn correct(&mut self, tick: u64, control: &Inputs) -> Option<Ports> {
        let paths = self.setup.feedforward.path_times();
        let mut energy = self.state.energy.take();
        let seen = self.state.context(tick, self.period_s(), control, paths);
        let correction = self.compensator.wrench(&seen);
        let budget = self.setup.limits.energy_gained.zip(energy.as_mut());
        let (gained, damping) = budget.map_or_else(Default::default, |(budget, energy)| {
            energy.see(&seen, &correction.unwrap_or_default());
            energy.within(budget, &seen)
        });
        (self.state.energy, self.state.gained) = (energy, gained);
        damping.map_or(correction, |d| Some(correction.unwrap_or_default() + d))
    }

    /// Motion at `t_{k+1}`, and the phase of the next tick.
    fn advance(&mut self, correction: Option<&Ports>, control: &Inputs) -> RelativeMotion {
        let t = self.period_s();
        let (settle, dry) = (self.ticks(self.setup.approach.settle_s), self.setup.dry_run);
        let s = &self.state;
        let first = self.ticks(s.plan.first.duration_s);
        let run_up = self.ticks(s.plan.run_up.duration_s);
        let there_and_back = self.ticks(2.0 * s.plan.there.duration_s + s.plan.first.duration_s);
        let s = &mut self.state;
        s.since += 1;
        #[expect(clippy::cast_precision_loss, reason = "ticks far below 2^53")]
        let time_s = s.since as f64 * t;
        let since = s.since;
        let mut next = None;
        let motion = match s.phase {
            Phase::Move => {
                next = (since >= first).then_some(Phase::Settle);
                s.plan.first.at(time_s)
            }
            Phase::Settle => {
                if since >= settle {
                    s.conditioning.tare();
                    let reference_a = Some(s.conditioning.reference().a);
                    let setup = &self.setup;
                    s.guard = guard(&setup.rig, &setup.limits, s.last.capabilities, reference_a);
                    next = Some(Phase::RunUp);
                }
                s.plan.first.at(s.plan.first.duration_s)
            }
            Phase::RunUp if dry => {
                next = (since >= there_and_back).then_some(Phase::Stop);
                s.plan.there_and_back(time_s)
            }
            Phase::RunUp => {
                // Ends on a tick: the plan is stretched by less than one.
                #[expect(clippy::cast_precision_loss, reason = "ticks far below 2^53")]
                let left_s = (run_up - since) as f64 * t;
                next = (since >= run_up).then_some(Phase::Closed);
                s.plan.run_up.at(s.plan.run_up.duration_s - left_s)
            }
            Phase::Closed => {
                next = (s.closed + 1 >= self.setup.ticks).then_some(Phase::Stop);
                s.close(correction, control, t)
            }
            // The rig brakes by itself.
            Phase::Stop => RelativeMotion { x_34: s.measured.x_34, ..RelativeMotion::default() },
        };
        match next {
            Some(Phase::Stop) => self.enter_stop(),
            Some(phase) => (s.phase, s.since) = (phase, 0),
            None => {}
        }
        motion
    }

    /// The command for `motion`. Without one that the legs can hold it is not finite, and the supervisor
    /// stops the run.
    fn command(
        &mut self,
        tick: u64,
        due_ns: u64,
        motion: &RelativeMotion,
        control: &Inputs,
    ) -> Commanded {
        let mut message = self.still(RigMode::Track, due_ns);
        if self.state.phase == Phase::Stop {
            return Commanded { message, legs: None };
        }
        let period_s = self.period_s();
        let (setup, platform) = (&self.setup, &self.platform);
        let paths = setup.feedforward.path_times();
        let demand = {
            let seen = self.state.context(tick, period_s, control, paths);
            self.compensator.command(&seen, motion)
        };
        let s = &mut self.state;
        let demand = *s.held_back.pass(demand, setup.added_ticks);
        let plate = plate_motion(platform, &demand.pose);
        s.in_flight.rotate_right(1);
        s.in_flight[0] = plate;
        s.commanded = platform.docking_from_plate(&plate.x_bp);
        let [flow, force] = [demand.flow, demand.force]
            .map(|path| path.map(|target| plate_motion(platform, &target)));
        let legs = setup.feedforward.command_paths(&plate, flow.as_ref(), force.as_ref());
        let Ok(legs) = legs else {
            message.plate_position_m = [f64::NAN; 3];
            return Commanded { message, legs: Some([[f64::NAN; 6]; 2]) };
        };
        let external = force.unwrap_or(plate).external;
        let motion = Motion { legs: legs.legs, arrival: plate, external };
        write_motion(&mut message, s.form, &motion, &setup.parameters.corrections, paths);
        let of = |read: fn(&docktwin_control::feedforward::LegCommand) -> f64| {
            core::array::from_fn(|i| read(&legs.legs[i]))
        };
        Commanded { message, legs: Some([of(|l| l.length_m), of(|l| l.speed_m_s)]) }
    }

    /// True when a sensor that closes the loop is gone: sensor A, or with two sensors B, or the
    /// accelerometers that were there at arming, without which what B carries cannot be taken off.
    fn sensors_gone(&self) -> bool {
        use Capabilities as C;
        let s = &self.state;
        let needed = match (self.setup.scheme, s.accelerations.is_some()) {
            (SensorScheme::Single, _) => C::SENSOR_A,
            (SensorScheme::Two, false) => C::SENSOR_A | C::SENSOR_B,
            (SensorScheme::Two, true) => C::SENSOR_A | C::SENSOR_B | C::ACCELEROMETER,
        };
        !s.last.has(needed)
    }

    /// True when a sensor is at the end of its range, or gone.
    fn saturated(&self) -> bool {
        let force = Status::SENSOR_A_SATURATED | Status::SENSOR_B_SATURATED;
        let ends = match self.setup.scheme {
            SensorScheme::Single => force,
            SensorScheme::Two => force | Status::ACCELEROMETER_SATURATED,
        };
        self.state.last.status.intersects(ends) || self.sensors_gone()
    }

    fn judge(&mut self, commanded: &Commanded) -> Option<Trip> {
        let s = &self.state;
        // Before the first measurement only its absence can be checked.
        let watched = if s.without > 0 && s.last.session == 0 {
            Watched { stroke_margin_m: f64::MAX, ticks_without: s.without, ..Watched::default() }
        } else {
            self.watched(commanded)
        };
        self.state.supervisor.judge(&watched, self.tick)
    }

    /// What was measured, and what is about to be commanded: what passes a limit must not be sent either,
    /// or the rig would have it for a tick.
    fn watched(&self, commanded: &Commanded) -> Watched {
        let s = &self.state;
        let (m, seen) = (&s.last, &s.measured);
        let rig = &self.setup.rig;
        let open = s.phase == Phase::Stop;
        // The command before last is of the present instant.
        let plan = s.in_flight[1].x_bp;
        let apart = plan.inverse() * seen.x_bp;
        let turned = apart.q.to_scaled_axis().length() * self.platform.plate_radius_m();
        let ahead = commanded.legs.filter(|_| !open).map(|[lengths, speeds]| Watched {
            stroke_margin_m: least(&self.platform.stroke_margins_m(&lengths)),
            leg_speed_m_s: largest(&speeds),
            pose_half_widths: half_widths(rig, &s.commanded),
            tracking_error_m: if commanded.message.is_finite() { 0.0 } else { f64::NAN },
            ..Watched::default()
        });
        let nothing = Watched { stroke_margin_m: f64::INFINITY, ..Watched::default() };
        let ahead = ahead.unwrap_or(nothing);
        // Without length sensors the lengths follow from the pose and the geometry of the file.
        let lengths = seen.leg_length_m.unwrap_or_else(|| self.platform.at(&seen.x_bp).length_m);
        let stroke_margin_m = least(&self.platform.stroke_margins_m(&lengths));
        let larger = |a: DVec3, b: DVec3| {
            let (a, b) = (a.length(), b.length());
            if a > b || a.is_nan() { a } else { b }
        };
        let [port3, port4] = [&s.ports.port3, &s.ports.port4];
        let left = Status::SAFE_STATE | Status::EMERGENCY_STOP | Status::LIMIT_SWITCH;
        Watched {
            stroke_margin_m: stroke_margin_m.min(ahead.stroke_margin_m),
            leg_speed_m_s: seen.leg_speed_m_s.map_or(0.0, |v| largest(&v)).max(ahead.leg_speed_m_s),
            leg_force_n: seen.leg_force_n.map(|f| largest(&f)),
            port_force_n: larger(port3.f, port4.f),
            port_moment_nm: larger(port3.m, port4.m),
            pose_half_widths: half_widths(rig, &seen.x_34).max(ahead.pose_half_widths),
            tracking_error_m: if open { 0.0 } else { apart.p.length().max(turned) }
                + ahead.tracking_error_m,
            ticks_without: s.without,
            rig_left: !open && (m.status.intersects(left) || !m.is(Status::ENABLED)),
            saturated: self.saturated(),
            ticks_frozen: s.frozen.into_iter().fold(0, u32::max),
            energy_gained: self.setup.limits.energy_gained.map(|_| s.gained.share),
        }
    }
}

impl Running {
    /// A tick of the closed loop: the bodies take the measured wrenches, corrected where the compensator
    /// corrects them.
    fn close(
        &mut self,
        correction: Option<&Ports>,
        control: &Inputs,
        period_s: f64,
    ) -> RelativeMotion {
        let taken = correction.map_or(self.ports, |c| self.ports + *c);
        // The loop is closed in free flight: what is measured then is noise and what the tare left, and
        // comes in gradually.
        #[expect(clippy::cast_precision_loss, reason = "ticks far below 2^53")]
        let share = (self.closed as f64 * period_s / CLOSING_S).min(1.0);
        let taken = taken * share;
        self.closed += 1;
        self.bodies.tick(&taken.port3, &taken.port4, control)
    }
}

/// Motion of the plate that reproduces a relative motion, with the contact expected there.
fn plate_motion(platform: &Platform, target: &Target) -> PlateMotion {
    let m = &target.motion;
    let rates = [m.twist, m.acceleration, m.jerk];
    let mut out = PlateMotion::of_docking(platform, &m.x_34, &rates);
    if let Some(contact) = &target.contact {
        out.external = platform.wrench_from_port(&out.x_bp, &contact.port4);
        out.external_rate = platform.wrench_from_port(&out.x_bp, &contact.rate);
    }
    out
}

/// A measurement in the loop's own terms, with the plate at `x_bp`.
fn measured(m: &RigMeasurement, platform: &Platform, x_bp: &Pose) -> Measured {
    use Capabilities as C;
    let held = |bit, x: &[f64; 6]| m.has(bit).then_some(*x);
    let leg_speed_m_s = held(C::LEG_SPEED, &m.leg_speed_m_s)
        .or_else(|| m.plate_twist().map(|twist| platform.at(x_bp).rates(&twist)));
    let mut latches = [None; LATCHES];
    for (latch, phase) in latches.iter_mut().zip(m.latch_phases()) {
        *latch = Some(*phase);
    }
    Measured {
        fresh: true,
        age_s: 0.0,
        sensor_a: m.has(C::SENSOR_A).then(|| wrench(&m.sensor_a)),
        sensor_b: m.has(C::SENSOR_B).then(|| wrench(&m.sensor_b)),
        accelerometer: m.accelerometer(),
        leg_length_m: held(C::LEG_LENGTH, &m.leg_length_m),
        leg_speed_m_s,
        leg_force_n: held(C::LEG_FORCE, &m.leg_force_n),
        valve_spool: held(C::VALVE_SPOOL, &m.valve_spool),
        ring: m.ring(),
        latches,
        joined: m.is_joined(),
        x_bp: *x_bp,
        x_34: platform.docking_from_plate(x_bp),
    }
}

fn same_bits(a: &[f64; 6], b: &[f64; 6]) -> bool {
    a.map(f64::to_bits) == b.map(f64::to_bits)
}
