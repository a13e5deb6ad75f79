//! Contacts: from ticks to contacts with begin, end and peak, and to sentences.

use core::fmt;

use docktwin_core::DVec3;
use docktwin_record::ContactRow;

use crate::geometry::{Bodies, Geometry, among_petals, on_petal, side_of_axis};
use crate::words;

/// Two surfaces that part for less than this are one contact, s.
pub(crate) const CHATTER_S: f64 = 0.1;
/// Sliding slower than this is called sticking, m/s.
pub(crate) const STICKING_M_S: f64 = 1e-3;

/// A part of a mechanism that touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// The ring.
    Ring,
    /// A petal, from 1.
    Petal(u32),
}

/// Two surfaces that touch, one of each side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pair {
    /// As in the recording.
    pub name: String,
    /// The parts, active first; `None` for a pair whose name is not that of rings and petals.
    pub parts: Option<[Part; 2]>,
}

impl Pair {
    /// Reads the name a pair has in a recording, `active petal 2 · passive ring`.
    #[must_use]
    pub fn new(name: &str) -> Self {
        let part = |text: &str, side: &str| {
            let rest = text.trim().strip_prefix(side)?.trim();
            if rest == "ring" {
                return Some(Part::Ring);
            }
            let number = rest.strip_prefix("petal")?.trim().trim_end_matches('\'');
            number.parse().ok().filter(|n| *n > 0).map(Part::Petal)
        };
        let parts =
            name.split_once('·').and_then(|(a, p)| Some([part(a, "active")?, part(p, "passive")?]));
        Self { name: name.to_owned(), parts }
    }

    /// 0 ring on ring, 1 petal on ring, 2 petal on petal, 3 anything else.
    #[must_use]
    pub fn kind(&self) -> usize {
        match self.parts {
            Some([Part::Ring, Part::Ring]) => 0,
            Some([Part::Ring, Part::Petal(_)] | [Part::Petal(_), Part::Ring]) => 1,
            Some([Part::Petal(_), Part::Petal(_)]) => 2,
            None => 3,
        }
    }
}

/// Names of [`Pair::kind`].
pub(crate) const KINDS: [&str; 4] = ["ring on ring", "petal on ring", "petal on petal", "other"];

fn part_name(p: Part, letter: char) -> String {
    match p {
        Part::Ring => format!("ring {letter}"),
        Part::Petal(i) => format!("petal {letter}{i}"),
    }
}

impl fmt::Display for Pair {
    /// The petal first where there is one: `petal A2 on ring P`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.parts {
            None => f.write_str(&self.name),
            Some([a @ Part::Ring, p @ Part::Petal(_)]) => {
                write!(f, "{} on {}", part_name(p, 'P'), part_name(a, 'A'))
            }
            Some([a, p]) => write!(f, "{} on {}", part_name(a, 'A'), part_name(p, 'P')),
        }
    }
}

/// The tick of the largest normal force of a contact.
#[derive(Clone, Debug, PartialEq)]
pub struct Peak {
    /// When, s.
    pub time_s: f64,
    /// Normal force of the pair, N: the sum over its places.
    pub force_n: f64,
    /// Its strongest place, in the world, m.
    pub point_w_m: DVec3,
    /// Normal there, from the active to the passive surface.
    pub normal_w: DVec3,
    /// Velocity of the active surface over the passive one in the plane of contact, in the world,
    /// m/s; `None` without recorded motion.
    pub sliding_w_m_s: Option<DVec3>,
    /// The bodies then.
    pub(crate) bodies: Option<Bodies>,
}

/// Two surfaces that touched, with the touches that chattering made of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// Index of the pair.
    pub pair: usize,
    /// First tick in contact, s.
    pub begin_s: f64,
    /// Last tick in contact, s.
    pub end_s: f64,
    /// Time in contact, s; less than from begin to end when it chattered.
    pub touching_s: f64,
    /// How often the surfaces met.
    pub touches: usize,
    /// The largest normal force.
    pub peak: Peak,
    /// Integral of the normal force over time, N·s.
    pub impulse_ns: f64,
    /// Deepest, m.
    pub depth_m: f64,
    /// Whether the recording ended first.
    pub open: bool,
}

/// Follows all pairs tick by tick.
#[derive(Debug, Default)]
pub(crate) struct Collector {
    live: Vec<Option<Contact>>,
    /// Ticks since a live contact was last seen, as its last time.
    done: Vec<Contact>,
    last_s: Option<f64>,
    /// Largest step between ticks: what one tick is long.
    step_s: f64,
}

impl Collector {
    pub(crate) fn new(pairs: usize, step_s: f64) -> Self {
        Self { live: vec![None; pairs], done: Vec::new(), last_s: None, step_s }
    }

    /// One tick.
    pub(crate) fn tick(&mut self, t: f64, rows: &[ContactRow], bodies: Option<&Bodies>) {
        let dt = self.last_s.map_or(self.step_s, |last| t - last);
        self.last_s = Some(t);
        for (i, slot) in self.live.iter_mut().enumerate() {
            let of_pair = || rows.iter().filter(|r| usize::from(r.pair) == i);
            let Some(strongest) =
                of_pair().max_by(|a, b| a.normal_force_n.total_cmp(&b.normal_force_n))
            else {
                if slot.as_ref().is_some_and(|c| t - c.end_s > CHATTER_S) {
                    self.done.extend(slot.take());
                }
                continue;
            };
            let force: f64 = of_pair().map(|r| r.normal_force_n).sum();
            let depth = of_pair().map(|r| r.depth_m).fold(0.0, f64::max);
            let peak = || Peak {
                time_s: t,
                force_n: force,
                point_w_m: strongest.point_w_m,
                normal_w: strongest.normal_w,
                sliding_w_m_s: bodies.map(|b| sliding(b, strongest)),
                bodies: bodies.copied(),
            };
            match slot {
                Some(c) => {
                    // Seen at the tick before: the same touch.
                    if t - c.end_s > 1.5 * dt {
                        c.touches += 1;
                    }
                    c.end_s = t;
                    c.touching_s += dt;
                    c.impulse_ns += force * dt;
                    c.depth_m = c.depth_m.max(depth);
                    if force > c.peak.force_n {
                        c.peak = peak();
                    }
                }
                None => {
                    *slot = Some(Contact {
                        pair: i,
                        begin_s: t,
                        end_s: t,
                        touching_s: dt,
                        touches: 1,
                        peak: peak(),
                        impulse_ns: force * dt,
                        depth_m: depth,
                        open: false,
                    });
                }
            }
        }
    }

    /// All contacts in the order in which they began.
    pub(crate) fn finish(mut self) -> Vec<Contact> {
        let (last, step) = (self.last_s.unwrap_or(0.0), self.step_s);
        for mut c in self.live.into_iter().flatten() {
            c.open = last - c.end_s < 1.5 * step;
            self.done.push(c);
        }
        self.done.sort_by(|a, b| a.begin_s.total_cmp(&b.begin_s).then(a.pair.cmp(&b.pair)));
        self.done
    }
}

/// Velocity of the active surface over the passive one in the plane of contact.
pub(crate) fn sliding(b: &Bodies, row: &ContactRow) -> DVec3 {
    let v = b.velocity(1, row.point_w_m) - b.velocity(2, row.point_w_m);
    v - row.normal_w * v.dot(row.normal_w)
}

/// A velocity in words, seen from the docking axis: `inward`, `clockwise and forward`.
pub(crate) fn direction(v: DVec3, at: DVec3, b: &Bodies) -> String {
    // The active ring's axis points toward the target; its mass centre lies on the axis.
    let ring = b.pose[1];
    let axis = ring.q * DVec3::X;
    let arm = at - ring.p;
    let radial = (arm - axis * arm.dot(axis)).normalize_or_zero();
    // A turn about +X is clockwise for whoever looks along +X.
    let around = axis.cross(radial);
    let mut parts = [
        (v.dot(radial), "outward", "inward"),
        (v.dot(axis), "forward", "back"),
        (v.dot(around), "clockwise", "anticlockwise"),
    ];
    parts.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let word = |p: &(f64, &'static str, &'static str)| if p.0 > 0.0 { p.1 } else { p.2 };
    // Within 30° of the first one, the second is not named.
    if parts[1].0.abs() > 0.577 * parts[0].0.abs() {
        format!("{} and {}", word(&parts[0]), word(&parts[1]))
    } else {
        word(&parts[0]).to_owned()
    }
}

/// `sliding inward at 0.120 m/s`, `sticking`.
pub(crate) fn sliding_words(v: DVec3, at: DVec3, b: &Bodies) -> String {
    let speed = v.length();
    if speed < STICKING_M_S {
        "sticking".to_owned()
    } else {
        format!("sliding {} at {} m/s", direction(v, at, b), words::three(speed))
    }
}

/// Where two surfaces meet: `near the tip, between petals P1 and P2`.
pub(crate) fn place(pair: &Pair, at: DVec3, b: &Bodies, g: &Geometry) -> Option<String> {
    let poses = g.poses(b);
    let m = &g.mechanism;
    let (in_r, in_p) =
        (poses.x_wr.inverse_transform_point(at), poses.x_wp.inverse_transform_point(at));
    let side = || side_of_axis(poses.x_w3.inverse_transform_point(at));
    Some(match pair.parts? {
        [Part::Ring, Part::Ring] => side(),
        [Part::Petal(i), Part::Ring] => {
            let petal = on_petal(m.active.petals.as_ref()?, i - 1, in_r);
            format!("{petal}, {}", among_petals(&m.passive, 'P', in_p).unwrap_or_else(side))
        }
        [Part::Ring, Part::Petal(i)] => {
            let petal = on_petal(m.passive.petals.as_ref()?, i - 1, in_p);
            format!("{petal}, {}", among_petals(&m.active, 'A', in_r).unwrap_or_else(side))
        }
        [Part::Petal(i), Part::Petal(j)] => format!(
            "(A{i} {}; P{j} {})",
            on_petal(m.active.petals.as_ref()?, i - 1, in_r),
            on_petal(m.passive.petals.as_ref()?, j - 1, in_p)
        ),
    })
}

/// The first sentence of a contact: `petal P3 meets ring A near the tip, between petals A1 and A2`.
pub(crate) fn meeting(c: &Contact, pair: &Pair, g: Option<&Geometry>) -> String {
    let (first, second) = match pair.parts {
        None => return format!("{} touch", pair.name),
        Some([a @ Part::Ring, p @ Part::Petal(_)]) => (part_name(p, 'P'), part_name(a, 'A')),
        Some([a, p]) => (part_name(a, 'A'), part_name(p, 'P')),
    };
    let where_ = c
        .peak
        .bodies
        .as_ref()
        .zip(g)
        .and_then(|(b, g)| place(pair, c.peak.point_w_m, b, g))
        .map_or(String::new(), |p| format!(" {p}"));
    format!("{first} meets {second}{where_}")
}

/// How it slides at its peak.
pub(crate) fn peak_sliding(c: &Contact) -> Option<String> {
    let b = c.peak.bodies.as_ref()?;
    Some(sliding_words(c.peak.sliding_w_m_s?, c.peak.point_w_m, b))
}

/// The figures of a contact, in one line.
pub(crate) fn figures(c: &Contact) -> String {
    let touches = if c.touches > 1 { format!(" in {} touches", c.touches) } else { String::new() };
    let until = if c.open {
        "lasting to the end of the record".to_owned()
    } else {
        format!("until {}", words::at(c.end_s))
    };
    format!(
        "{until} · {} in contact{touches} · deepest {} · impulse {} N·s",
        words::seconds(c.touching_s),
        words::metres(c.depth_m),
        words::three(c.impulse_ns)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use docktwin_core::{DQuat, Pose, Twist};

    fn row(pair: u16, force: f64, depth: f64) -> ContactRow {
        ContactRow {
            pair,
            point_w_m: DVec3::new(0.3, 0.6, 0.0),
            normal_w: DVec3::X,
            depth_m: depth,
            normal_force_n: force,
            friction_w_n: DVec3::ZERO,
        }
    }

    fn bodies(v_ring: DVec3, v_target: DVec3) -> Bodies {
        let still = Twist::default();
        let pose = |x: f64| Pose::new(DVec3::X * x, DQuat::IDENTITY);
        Bodies {
            pose: [pose(-3.0), pose(0.3), pose(3.0)],
            twist: [still, Twist { v: v_ring, ..still }, Twist { v: v_target, ..still }],
            relative: DVec3::X,
        }
    }

    #[test]
    fn oracle_names_of_pairs_are_read() {
        let p = Pair::new("active ring · passive petal 3'");
        assert_eq!(p.parts, Some([Part::Ring, Part::Petal(3)]));
        assert_eq!((p.to_string().as_str(), p.kind()), ("petal P3 on ring A", 1));
        let p = Pair::new("active petal 1 · passive petal 2'");
        assert_eq!((p.to_string().as_str(), p.kind()), ("petal A1 on petal P2", 2));
        assert_eq!(Pair::new("active ring · passive ring").kind(), 0);
        let odd = Pair::new("hook · eye");
        assert_eq!((odd.to_string().as_str(), odd.kind(), odd.parts), ("hook · eye", 3, None));
        assert_eq!(Pair::new("active petal 0 · passive ring").parts, None, "petals begin at 1");
    }

    #[test]
    fn oracle_spans_peaks_and_impulses_of_made_up_ticks() {
        let mut c = Collector::new(2, 1e-3);
        // Pair 0: 10 ms of 100 N with one tick of 250 N, then 30 ms apart, then 5 ms of 40 N:
        // one contact of two touches. Then 200 ms apart and one tick of 7 N: another contact.
        // Pair 1: from 0.018 s to the end.
        for k in 0..400u32 {
            let mut rows = Vec::new();
            match k {
                100..110 => rows.push(row(0, if k == 104 { 250.0 } else { 100.0 }, 1e-4)),
                140..145 => rows.push(row(0, 40.0, 3e-4)),
                345 => rows.push(row(0, 7.0, 1e-6)),
                _ => {}
            }
            if k >= 18 {
                // Two places of one pair count together.
                rows.extend([row(1, 1.0, 1e-5), row(1, 2.0, 2e-5)]);
            }
            c.tick(f64::from(k) * 1e-3, &rows, None);
        }
        let all = c.finish();
        assert_eq!(all.iter().map(|c| c.pair).collect::<Vec<_>>(), [1, 0, 0]);
        let (long, first, second) = (&all[0], &all[1], &all[2]);
        assert!(long.open && !first.open && !second.open);
        assert!((long.peak.force_n - 3.0).abs() < 1e-12);
        assert!((long.impulse_ns - 0.382 * 3.0).abs() < 1e-9);
        assert_eq!((first.touches, second.touches), (2, 1));
        assert!((first.begin_s - 0.1).abs() < 1e-12 && (first.end_s - 0.144).abs() < 1e-12);
        assert!((first.touching_s - 0.015).abs() < 1e-9);
        assert!((first.peak.force_n - 250.0).abs() < 1e-12);
        assert!((first.peak.time_s - 0.104).abs() < 1e-12);
        assert!((first.impulse_ns - (0.9 + 0.25 + 0.2)).abs() < 1e-9);
        assert!((first.depth_m - 3e-4).abs() < 1e-15);
        assert!((second.begin_s - 0.345).abs() < 1e-12);
    }

    #[test]
    fn oracle_sliding_is_that_of_the_active_over_the_passive_surface() {
        // At +Y of the axis: the active ring moves toward the axis, the target along it.
        let b = bodies(DVec3::new(0.02, -0.1, 0.0), DVec3::new(-0.05, 0.02, 0.0));
        let v = sliding(&b, &row(0, 1.0, 1e-4));
        assert!(
            (v - DVec3::new(0.0, -0.12, 0.0)).length() < 1e-15,
            "the normal part is not sliding"
        );
        let at = DVec3::new(0.3, 0.6, 0.0);
        assert_eq!(sliding_words(v, at, &b), "sliding inward at 0.120 m/s");
        for (v, want) in [
            (DVec3::new(0.0, 0.1, 0.0), "outward"),
            (DVec3::new(0.1, 0.0, 0.0), "forward"),
            (DVec3::new(-0.1, 0.0, 0.01), "back"),
            // At +Y, a turn about +X goes toward +Z.
            (DVec3::new(0.0, 0.0, 0.1), "clockwise"),
            (DVec3::new(0.0, 0.1, -0.09), "outward and anticlockwise"),
        ] {
            assert_eq!(direction(v, at, &b), want, "{v}");
        }
        assert_eq!(sliding_words(DVec3::Y * 5e-4, at, &b), "sticking");
    }

    #[test]
    fn oracle_a_turning_body_carries_its_surface() {
        let mut b = bodies(DVec3::ZERO, DVec3::ZERO);
        // 0.1 rad/s about +X at 0.6 m from the axis: 0.06 m/s toward +Z.
        b.twist[1].w = DVec3::X * 0.1;
        let v = sliding(&b, &row(0, 1.0, 1e-4));
        assert!((v - DVec3::Z * 0.06).length() < 1e-15);
        assert_eq!(direction(v, DVec3::new(0.3, 0.6, 0.0), &b), "clockwise");
    }

    #[test]
    fn regress_the_words_of_a_contact() {
        let mut c = Collector::new(1, 1e-3);
        let b = bodies(DVec3::new(0.0, -0.05, 0.0), DVec3::ZERO);
        for k in 0..300u32 {
            let rows = if (50..64).contains(&k) { vec![row(0, 1912.0, 2.16e-4)] } else { vec![] };
            c.tick(f64::from(k) * 1e-3, &rows, Some(&b));
        }
        let all = c.finish();
        assert_eq!(all.len(), 1);
        let pair = Pair::new("active petal 2 · passive ring");
        assert_eq!(meeting(&all[0], &pair, None), "petal A2 meets ring P");
        assert_eq!(peak_sliding(&all[0]).unwrap(), "sliding inward at 0.0500 m/s");
        assert_eq!(
            figures(&all[0]),
            "until 0.063 s · 14 ms in contact · deepest 0.216 mm · impulse 26.8 N·s"
        );
    }
}
