//! From a recorded tick to what the viewer shows: the same code draws a run while it happens and
//! afterwards, so that `run.rrd` can be made from `run.mcap` again and is the same.

use std::collections::BTreeSet;

use docktwin_core::{DQuat, DVec3, Pose, SimTime, Tick, Wrench};
use docktwin_physics::mechanism::{System, pair_count, pair_names as pair_names_of};
use docktwin_record::{Cell, Column, ContactRow, RunReader, TickRecord};
use docktwin_scenario::Scenario;
use docktwin_view::{ContactArrow, Energies, Frame, Scalars, SceneModel, SceneWriter, ViewError};

use crate::error::PlaybackError;

/// Between two frames while surfaces touch or something happens, and for [`SETTLING_NS`] after, ns.
const LIVELY_NS: u64 = 10_000_000;
/// Between two frames otherwise, ns: a coasting spacecraft is well drawn twenty times a second.
const QUIET_NS: u64 = 50_000_000;
/// How long a scene counts as lively after the last touch or event, ns: the ring swings back.
const SETTLING_NS: u64 = 300_000_000;

const DEGREES: f64 = 180.0 / core::f64::consts::PI;

/// Names of the pairs that frames speak of: pairs of surfaces in the order of
/// [`docktwin_physics::contact::SurfacePair::from_index`], then the first three latches.
#[must_use]
pub fn pair_names(scenario: &Scenario) -> Vec<String> {
    let surfaces = pair_names_of(&scenario.mechanism).into_iter();
    surfaces.chain((1..=3).map(|i| format!("latch {i}"))).collect()
}

/// What does not change in the scene of a scenario, recorded in these columns.
#[must_use]
pub fn scene_model<'a>(scenario: &'a Scenario, columns: &[Column]) -> SceneModel<'a> {
    SceneModel {
        with_rig: columns.iter().any(|c| c.name == "loop_phase"),
        scenario: &scenario.name,
        chaser: &scenario.chaser,
        target: &scenario.target,
        mechanism: &scenario.mechanism,
    }
}

/// Where the numbers of a scene stand in a row. Vectors and quaternions take neighbouring cells.
struct Cells {
    position: [usize; 3],
    attitude: [usize; 3],
    relative: [usize; 4],
    ring: [usize; 2],
    port3: [usize; 2],
    port4: [usize; 2],
    /// Another engine's recording may lack the energy account.
    energy: [Option<usize>; 7],
    phase: [usize; 3],
    gap: [usize; 3],
    /// Not in recordings of the first version.
    latch_force: Option<[usize; 3]>,
}

impl Cells {
    fn find(columns: &[Column]) -> Result<Self, PlaybackError> {
        let mut missing = Vec::new();
        let index = |name: &str| columns.iter().position(|c| c.name == name);
        let latch_force = ["latch_1", "latch_2", "latch_3"]
            .map(|l| index(&format!("{l}_force_x_n")))
            .into_iter()
            .collect::<Option<Vec<usize>>>()
            .and_then(|v| v.try_into().ok());
        let mut at = |name: &str| {
            index(name).unwrap_or_else(|| {
                missing.push(name.to_owned());
                0
            })
        };
        let bodies = ["chaser", "ring", "target"];
        let latches = [1, 2, 3];
        let cells = Self {
            position: bodies.map(|b| at(&format!("{b}_position_x_m"))),
            attitude: bodies.map(|b| at(&format!("{b}_attitude_w"))),
            relative: [
                at("relative_position_x_m"),
                at("relative_attitude_x_rad"),
                at("relative_velocity_x_m_s"),
                at("relative_rate_x_rad_s"),
            ],
            ring: [at("ring_deflection_x_m"), at("ring_rotation_x_rad")],
            port3: [at("port3_force_x_n"), at("port3_moment_x_nm")],
            port4: [at("port4_force_x_n"), at("port4_moment_x_nm")],
            energy: [
                "kinetic",
                "stored",
                "lost_friction",
                "lost_contact",
                "lost_joint",
                "lost_capture",
                "lost_attenuator",
            ]
            .map(|k| index(&format!("energy_{k}_j"))),
            phase: latches.map(|i| at(&format!("latch_{i}_phase"))),
            gap: latches.map(|i| at(&format!("latch_{i}_gap_m"))),
            latch_force,
        };
        if missing.is_empty() { Ok(cells) } else { Err(PlaybackError::Columns { missing }) }
    }
}

/// Turns ticks into frames.
pub struct Playback {
    system: System,
    /// `X_31` and `X_42`.
    from_port: [Pose; 2],
    /// In `r4`, m.
    strikers: Option<[DVec3; 3]>,
    /// Pairs of surfaces, after which the latches are counted.
    pairs: usize,
    cells: Cells,
    arrows: Vec<ContactArrow>,
    pace: Pace,
}

/// Decides which ticks become frames: many only where there is something to see, because frames are
/// the largest part of what a recording costs the run.
#[derive(Default)]
struct Pace {
    last_frame: Option<SimTime>,
    /// Caught latches push for the rest of the run, so they do not count.
    last_lively: Option<SimTime>,
}

impl Pace {
    fn drawn(&mut self, time: SimTime, touching: bool, due: bool) -> bool {
        let now = time.nanos();
        if touching || due {
            self.last_lively = Some(time);
        }
        let lively = self.last_lively.is_some_and(|t| now - t.nanos() <= SETTLING_NS);
        let interval = if lively { LIVELY_NS } else { QUIET_NS };
        let drawn = due || self.last_frame.is_none_or(|t| now / interval != t.nanos() / interval);
        if drawn {
            self.last_frame = Some(time);
        }
        drawn
    }
}

impl Playback {
    /// For rows of these columns.
    ///
    /// # Errors
    /// [`PlaybackError::Columns`] with every column that is missing.
    pub fn new(scenario: &Scenario, columns: &[Column]) -> Result<Self, PlaybackError> {
        let m = &scenario.mechanism;
        let own = || {
            let first = |i: usize| m.own_latches.get(i).map_or(DVec3::ZERO, |l| l.striker_p);
            (!m.own_latches.is_empty()).then(|| core::array::from_fn(first))
        };
        let strikers = m.latches.as_ref().map(|l| {
            l.azimuths_rad.map(|a| {
                let ring = &m.passive.ring;
                let radius = m.active.ring.mean_radius_m;
                // r4 is r3 turned by half a turn about Z when docked.
                DVec3::new(ring.section_radius_m, -radius * a.cos(), radius * a.sin())
            })
        });
        let strikers = strikers.or_else(own);
        Ok(Self {
            system: System::new(&scenario.chaser, &scenario.target, m.clone()),
            from_port: [&scenario.chaser, &scenario.target].map(|s| s.x_body_port.inverse()),
            strikers,
            pairs: pair_count(m),
            cells: Cells::find(columns)?,
            arrows: Vec::new(),
            pace: Pace::default(),
        })
    }

    /// Hands one tick over, in the order of time: as a frame when it is `due` (it has an event, or is
    /// the last) or when it is time for one, otherwise for its peaks alone.
    ///
    /// # Errors
    /// What [`SceneWriter::frame`] refuses.
    pub fn show(
        &mut self,
        view: &mut SceneWriter,
        time: SimTime,
        row: &[Cell],
        contacts: &[ContactRow],
        due: bool,
    ) -> Result<(), ViewError> {
        let c = &self.cells;
        let number = |i: usize| row[i].as_f64();
        let vector = |i: usize| DVec3::new(number(i), number(i + 1), number(i + 2));
        let poses = self.system.poses(&core::array::from_fn(|b| {
            let q = c.attitude[b];
            let q = DQuat::from_xyzw(number(q + 1), number(q + 2), number(q + 3), number(q));
            Pose { p: vector(c.position[b]), q }
        }));
        self.arrows.clear();
        // Recorded is what the passive side feels; the viewer shows what the active side does.
        self.arrows.extend(contacts.iter().map(|k| ContactArrow {
            pair: usize::from(k.pair),
            point_w_m: k.point_w_m,
            normal_force_w_n: -k.normal_w * k.normal_force_n,
            friction_w_n: -k.friction_w_n,
            depth_m: k.depth_m,
        }));
        let normal_sum = contacts.iter().map(|k| k.normal_force_n).sum();
        if let (Some(cells), Some(strikers)) = (c.latch_force, self.strikers) {
            for (i, (cell, striker)) in cells.into_iter().zip(strikers).enumerate() {
                let f = vector(cell);
                if f != DVec3::ZERO {
                    let along = DVec3::X * f.x;
                    self.arrows.push(ContactArrow {
                        pair: self.pairs + i,
                        point_w_m: poses.x_wp.transform_point(striker),
                        normal_force_w_n: poses.x_wr.q * -along,
                        friction_w_n: poses.x_wr.q * (along - f),
                        depth_m: 0.0,
                    });
                }
            }
        }
        let drawn = self.pace.drawn(time, !contacts.is_empty(), due);
        let [kinetic, stored, friction, contact, joint, capture, attenuator] =
            c.energy.map(|i| i.map_or(f64::NAN, number));
        let between = Wrench { f: vector(c.port4[0]), m: vector(c.port4[1]) }
            .rotated(poses.x_w4.q)
            .shifted(poses.x_wp.p - poses.x_w4.p);
        let gaps = if drawn {
            let g = self.system.scene().petal_gaps(poses.x_wr.inverse() * poses.x_wp);
            [g.active_m, g.passive_m]
        } else {
            [[f64::NAN; 3]; 2]
        };
        let [position, attitude, velocity, rate] = c.relative.map(vector);
        let [deflection, tilt] = c.ring.map(vector);
        let frame = Frame {
            time,
            // From the ports, because the chaser's mass centre moves when the ring is part of it.
            x_world_chaser: poses.x_w3 * self.from_port[0],
            x_world_target: poses.x_w4 * self.from_port[1],
            x_world_ring: poses.x_wr,
            contacts: &self.arrows,
            latches: c.phase.map(|i| u8::try_from(row[i].as_u64()).unwrap_or(u8::MAX)),
            scalars: &Scalars {
                relative_position_m: position,
                relative_attitude_deg: attitude * DEGREES,
                relative_velocity_m_s: velocity,
                relative_rate_deg_s: rate * DEGREES,
                ring_deflection_mm: deflection * 1e3,
                ring_tilt_deg: tilt * DEGREES,
                port_force_n: vector(c.port3[0]),
                port_moment_nm: vector(c.port3[1]),
                contact_normal_sum_n: normal_sum,
                energy: Energies {
                    kinetic_relative_j: kinetic,
                    stored_j: stored,
                    dissipated_friction_j: friction,
                    dissipated_contact_j: contact + joint + capture,
                    dissipated_attenuator_j: attenuator,
                },
                between_force_n: between.f.length(),
                between_moment_nm: between.m.length(),
                latch_gap_m: c.gap.map(number),
                petal_gap_m: gaps,
            },
        };
        if drawn { view.frame(&frame) } else { view.tick(&frame) }
    }
}

/// Shows a recording from its start to `until`, or to its end, and gives the time of the last tick.
/// The writer stays open.
///
/// # Errors
/// The recording lacks columns or cannot be read, or the scene cannot be written.
pub fn play(
    reader: &mut RunReader,
    scenario: &Scenario,
    view: &mut SceneWriter,
    until: Option<SimTime>,
) -> Result<Option<SimTime>, PlaybackError> {
    let mut playback = Playback::new(scenario, reader.columns())?;
    let tick_nanos = scenario.run.tick_nanos;
    let mut with_event = BTreeSet::new();
    let within = |t: SimTime| until.is_none_or(|u| t.nanos() <= u.nanos());
    for e in reader.events()? {
        let time = SimTime::of_tick(Tick(e.tick), tick_nanos);
        if within(time) {
            view.event(time, &e.kind, &e.text)?;
            with_event.insert(e.tick);
        }
    }
    reader.rewind()?;
    // One tick behind, because the last one is always drawn.
    let mut held: Option<TickRecord> = None;
    loop {
        let next = reader.next_tick()?.filter(|t| within(t.time));
        if let Some(t) = &held {
            let due = next.is_none() || with_event.contains(&t.tick.0);
            playback.show(view, t.time, &t.row, &t.contacts, due)?;
        }
        if next.is_none() {
            return Ok(held.map(|t| t.time));
        }
        held = next;
    }
}
