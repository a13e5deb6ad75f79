//! Pictures of the mechanism: surfaces in their poses, contacts with their forces, as SVG.

use core::fmt::Write as _;

use docktwin_core::{DVec3, Pose};
use docktwin_model::SideGeometry;
use docktwin_record::ContactRow;

use crate::geometry::{Geometry, Patch, Poses, petal_patches, ring_patches, surface_patches};
use crate::load::{Run, Snapshot};
use crate::moments::Moment;
use crate::story::{self, Pair};
use crate::words;

/// Units of the view box.
const WIDTH: f64 = 390.0;
const HEIGHT: f64 = 350.0;
const FONT: f64 = 12.0;
/// Length of the arrow of the run's strongest contact, units.
const ARROW: f64 = 95.0;
/// Steps of light on a surface; see the style of the page.
const SHADES: f64 = 7.0;
/// Contacts with a line of their own.
const LISTED: usize = 5;
/// Characters that fit into a line.
const LINE: usize = 60;

/// From where it is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// From the side, somewhat from the front and above.
    Oblique,
    /// Along the docking axis, from the chaser toward the target.
    Axis,
}

struct Camera {
    right: DVec3,
    up: DVec3,
    to_eye: DVec3,
    centre: DVec3,
    scale: f64,
}

impl Camera {
    /// In `e3`, on the middle between the rings.
    fn new(look: Look, g: &Geometry, poses: &Poses) -> Self {
        let in3 = |p: DVec3| poses.x_w3.inverse_transform_point(p);
        let (a, p) = (in3(poses.x_wr.p), in3(poses.x_wp.p));
        let to_eye = match look {
            Look::Oblique => DVec3::new(0.45, -0.80, 0.40).normalize(),
            Look::Axis => DVec3::NEG_X,
        };
        let right = DVec3::Z.cross(to_eye).normalize();
        let up = to_eye.cross(right);
        let reach = [&g.mechanism.active, &g.mechanism.passive]
            .iter()
            .map(|s| s.ring.mean_radius_m + s.ring.section_radius_m)
            .fold(0.1, f64::max);
        let (centre, apart) = (0.5 * (a + p), p - a);
        // Half of what must be seen, to the side and upward.
        let (x, y) = (apart.dot(right).abs(), apart.dot(up).abs());
        let (depth_x, depth_y) = match look {
            Look::Oblique => (1.12 * reach + 0.5 * x, 1.12 * reach + 0.5 * y),
            Look::Axis => (1.15 * reach + 0.5 * x, 1.15 * reach + 0.5 * y),
        };
        let scale = (0.5 * WIDTH / (depth_x + 0.12)).min(0.5 * (HEIGHT - 26.0) / depth_y);
        Self { right, up, to_eye, centre, scale }
    }

    /// Where a point of `e3` is seen.
    fn at(&self, p: DVec3) -> [f64; 2] {
        let d = p - self.centre;
        [
            0.5 * WIDTH + self.scale * d.dot(self.right),
            0.5 * HEIGHT + 6.0 - self.scale * d.dot(self.up),
        ]
    }

    fn depth(&self, p: DVec3) -> f64 {
        (p - self.centre).dot(self.to_eye)
    }
}

/// A contact as drawn and worded.
struct Shown<'a> {
    row: &'a ContactRow,
    pair: &'a Pair,
    words: String,
}

/// The contacts of a snapshot in words, strongest first: those of one pair together.
fn shown<'a>(run: &'a Run, s: &'a Snapshot) -> Vec<Shown<'a>> {
    let mut rows: Vec<&ContactRow> = s.contacts.iter().collect();
    rows.sort_by(|a, b| b.normal_force_n.total_cmp(&a.normal_force_n));
    rows.into_iter()
        .filter_map(|row| {
            let pair = run.pairs.get(usize::from(row.pair))?;
            let slides =
                story::sliding_words(story::sliding(&s.bodies, row), row.point_w_m, &s.bodies);
            let words = format!("{pair}: {}, {slides}", words::newtons(row.normal_force_n));
            Some(Shown { row, pair, words })
        })
        .collect()
}

/// What a picture shows, for those who do not see it.
pub(crate) fn caption(run: &Run, s: &Snapshot) -> Vec<String> {
    shown(run, s).into_iter().map(|c| c.words).collect()
}

/// Draws one view of a moment.
pub(crate) fn svg(run: &Run, g: &Geometry, m: &Moment, s: &Snapshot, look: Look) -> String {
    let poses = g.poses(&s.bodies);
    let camera = Camera::new(look, g, &poses);
    let contacts = shown(run, s);
    let mut body = String::new();
    planes(&mut body, g, &poses, &camera);
    surfaces(&mut body, g, &poses, &camera);
    let taken = names(&mut body, g, &poses, &camera, s, look);
    arrows(&mut body, run, &poses, &camera, &contacts, taken);
    if m.port {
        port(&mut body, &poses, &camera, s);
    }
    let strip = if look == Look::Oblique { strip(&mut body, run, m, s, &contacts) } else { 0.0 };
    let view = match look {
        Look::Oblique => "from the side",
        Look::Axis => "along the docking axis, from the chaser",
    };
    let label = format!("{} at {}, {view}", m.title, words::at(s.time_s));
    let height = HEIGHT + strip;
    format!(
        "<svg class=\"dtp\" viewBox=\"0 0 {WIDTH:.0} {height:.0}\" role=\"img\" \
         aria-label=\"{}\">{body}</svg>",
        escape(&label)
    )
}

fn escape(s: &str) -> String {
    s.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Writing to a String cannot fail, here and below.
fn text(out: &mut String, at: [f64; 2], s: &str, attributes: &str) {
    let _ = write!(
        out,
        "<text class=\"dtf8 halo\" x=\"{:.1}\" y=\"{:.1}\" font-size=\"{FONT}\"{attributes}>{}</text>",
        at[0],
        at[1],
        escape(s)
    );
}

/// The planes of both ports as circles, and what carries the rings, as thin lines behind all.
fn planes(out: &mut String, g: &Geometry, poses: &Poses, camera: &Camera) {
    let in3 = |x: &Pose, p: DVec3| poses.x_w3.inverse_transform_point(x.transform_point(p));
    let m = &g.mechanism;
    let circle = |r: f64, k: u32| {
        let (s, c) = (f64::from(k) * core::f64::consts::TAU / 48.0).sin_cos();
        DVec3::new(0.0, r * c, r * s)
    };
    for (x, ring, radius, class) in [
        (&poses.x_w3, &poses.x_wr, m.active.ring.mean_radius_m, "la"),
        (&poses.x_w4, &poses.x_wp, m.passive.ring.mean_radius_m, "lp"),
    ] {
        let mut d = String::new();
        for k in 0..=48 {
            let [u, v] = camera.at(in3(x, circle(radius, k)));
            let _ = write!(d, "{}{u:.1} {v:.1}", if k == 0 { "M" } else { "L" });
        }
        for k in (0..48).step_by(8) {
            // The passive ring's frame is turned by half a turn about Z.
            let there = if class == "la" { k } else { (72 - k) % 48 };
            let [a, b] = camera.at(in3(x, circle(radius, k)));
            let [u, v] = camera.at(in3(ring, circle(radius, there)));
            let _ = write!(d, "M{a:.1} {b:.1}L{u:.1} {v:.1}");
        }
        let _ = write!(out, "<path class=\"{class}\" d=\"{d}\" fill=\"none\"/>");
    }
}

/// Rings, petals and listed surfaces, far ones first.
fn surfaces(out: &mut String, g: &Geometry, poses: &Poses, camera: &Camera) {
    let light = (camera.to_eye + 0.7 * camera.up - 0.5 * camera.right).normalize();
    let mut all: Vec<(f64, String)> = Vec::new();
    let mut add = |patches: Vec<Patch>, x: &Pose, letter: char| {
        for p in patches {
            let c = p.corners.map(|c| poses.x_w3.inverse_transform_point(x.transform_point(c)));
            let n = (c[2] - c[0]).cross(c[3] - c[1]).normalize_or_zero();
            let facing = n.dot(camera.to_eye);
            if facing <= 0.0 && !p.two_sided {
                continue;
            }
            let n = if facing < 0.0 { -n } else { n };
            #[expect(clippy::cast_possible_truncation, reason = "0 to 7")]
            let shade = (n.dot(light).max(0.0) * SHADES).round() as i32;
            let depth = camera.depth((c[0] + c[1] + c[2] + c[3]) / 4.0);
            let mut d = String::new();
            let mut last = [0.0f64; 2];
            for (i, corner) in c.into_iter().enumerate() {
                let at = camera.at(corner).map(|v| (v * 10.0).round() / 10.0);
                let step = if i == 0 { at } else { [at[0] - last[0], at[1] - last[1]] };
                let letter = if i == 0 { "M" } else { "l" };
                let _ = write!(d, "{letter}{} {}", short(step[0]), short(step[1]));
                last = at;
            }
            let through = if p.glass { " fill-opacity=\".3\" stroke-opacity=\".3\"" } else { "" };
            all.push((depth, format!("<path class=\"{letter}{shade}\"{through} d=\"{d}z\"/>")));
        }
    };
    for (side, x, letter) in
        [(&g.mechanism.active, &poses.x_wr, 'a'), (&g.mechanism.passive, &poses.x_wp, 'p')]
    {
        if side.has_ring {
            add(ring_patches(side), x, letter);
        }
        for s in &side.surfaces {
            add(surface_patches(s), x, letter);
        }
        if let Some(petals) = &side.petals {
            for i in 0..petals.count {
                add(petal_patches(petals, i), x, letter);
            }
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    out.extend(all.into_iter().map(|(_, path)| path));
}

/// One decimal, without what is not needed.
fn short(v: f64) -> String {
    let t = format!("{v:.1}");
    let t = t.strip_suffix(".0").unwrap_or(&t);
    match t {
        "-0" => "0".to_owned(),
        t => t.replacen("0.", ".", usize::from(t.starts_with("0.") || t.starts_with("-0."))),
    }
}

/// Names of petals, latches and sides; gives the places they take.
fn names(
    out: &mut String,
    g: &Geometry,
    poses: &Poses,
    camera: &Camera,
    s: &Snapshot,
    look: Look,
) -> Vec<[f64; 2]> {
    let mut taken = Vec::new();
    // Far apart, the rings are too small for names.
    let readable = camera.scale * g.mechanism.active.ring.mean_radius_m > 60.0;
    let m = &g.mechanism;
    let in3 = |x: &Pose, p: DVec3| poses.x_w3.inverse_transform_point(x.transform_point(p));
    if look == Look::Axis {
        // The passive ring lies behind the active one; its outline shows how they are offset.
        outline(out, &m.passive, &poses.x_wp, poses, camera);
    }
    for (side, x, letter, class) in
        [(&m.active, &poses.x_wr, 'A', "ta"), (&m.passive, &poses.x_wp, 'P', "tp")]
    {
        let Some(petals) = side.petals.as_ref().filter(|_| readable) else { continue };
        for i in 0..petals.count {
            let [base, tip] = petals.ruling(i, 0.0);
            let at = camera.at(in3(x, base.lerp(tip, 0.72)));
            taken.push(at);
            let _ = write!(
                out,
                "<text class=\"{class} halo\" x=\"{:.1}\" y=\"{:.1}\" font-size=\"11\" \
                 font-weight=\"700\" text-anchor=\"middle\">{letter}{}</text>",
                at[0],
                at[1] + 4.0,
                i + 1
            );
        }
    }
    if let Some(latches) = m.latches.as_ref().filter(|_| readable) {
        for (i, a) in latches.azimuths_rad.iter().enumerate() {
            let ring = &m.active.ring;
            let p = DVec3::new(
                ring.section_radius_m,
                ring.mean_radius_m * a.cos(),
                ring.mean_radius_m * a.sin(),
            );
            let p3 = in3(&poses.x_wr, p);
            let at = camera.at(p3);
            let phase = s.latches[i].min(3);
            let outward = camera.at(in3(&poses.x_wr, DVec3::new(p.x, p.y * 1.11, p.z * 1.11)));
            taken.push(outward);
            let _ = write!(
                out,
                "<circle class=\"l{phase}\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"4.5\"/>\
                 <text class=\"dtf8 halo\" x=\"{:.1}\" y=\"{:.1}\" font-size=\"10\" \
                 text-anchor=\"middle\">L{}</text>",
                at[0],
                at[1],
                outward[0],
                outward[1] + 3.5,
                i + 1
            );
        }
    }
    let bold = " font-weight=\"700\"";
    match look {
        Look::Oblique => {
            side_name(out, [8.0, 16.0], "chaser, active side (A)", "ta", bold);
            side_name(
                out,
                [WIDTH - 8.0, 16.0],
                "target, passive side (P)",
                "tp",
                " font-weight=\"700\" text-anchor=\"end\"",
            );
        }
        Look::Axis => {
            text(out, [8.0, 16.0], "seen from the chaser, along +X", "");
            // Axes of e3: Z up, Y to the left.
            let o = [WIDTH - 24.0, HEIGHT - 16.0];
            let _ = write!(
                out,
                "<path class=\"dts9\" fill=\"none\" d=\"M{0} {1}v-32m-3 6l3 -6l3 6M{0} {1}h-32m6 -3l-6 3l6 3\"/>",
                o[0], o[1]
            );
            text(out, [o[0] + 4.0, o[1] - 26.0], "Z", "");
            text(out, [o[0] - 44.0, o[1] + 4.0], "Y", "");
        }
    }
    taken
}

fn side_name(out: &mut String, at: [f64; 2], s: &str, class: &str, attributes: &str) {
    let _ = write!(
        out,
        "<text class=\"{class} halo\" x=\"{}\" y=\"{}\" font-size=\"{FONT}\"{attributes}>{}</text>",
        at[0],
        at[1],
        escape(s)
    );
}

fn outline(out: &mut String, side: &SideGeometry, x: &Pose, poses: &Poses, camera: &Camera) {
    let mut d = String::new();
    for radius in [
        side.ring.mean_radius_m - side.ring.section_radius_m,
        side.ring.mean_radius_m + side.ring.section_radius_m,
    ] {
        for k in 0..=72 {
            let (s, c) = (f64::from(k) * core::f64::consts::TAU / 72.0).sin_cos();
            let p = x.transform_point(DVec3::new(0.0, radius * c, radius * s));
            let [u, v] = camera.at(poses.x_w3.inverse_transform_point(p));
            let _ = write!(d, "{}{u:.1} {v:.1}", if k == 0 { "M" } else { "L" });
        }
    }
    let _ = write!(out, "<path class=\"op\" d=\"{d}\" fill=\"none\"/>");
}

/// Force of each contact on the active side, with the number of its line.
fn arrows(
    out: &mut String,
    run: &Run,
    poses: &Poses,
    camera: &Camera,
    contacts: &[Shown<'_>],
    taken: Vec<[f64; 2]>,
) {
    let largest = run.strongest().map_or(1.0, |c| c.peak.force_n).max(1e-9);
    let mut badges = taken;
    for (i, c) in contacts.iter().enumerate() {
        let ink = match c.pair.kind() {
            0 => 6,
            1 => 3,
            2 => 2,
            _ => 7,
        };
        let force = -(c.row.normal_w * c.row.normal_force_n + c.row.friction_w_n);
        let from = camera.at(poses.x_w3.inverse_transform_point(c.row.point_w_m));
        let back = poses.x_w3.q.conjugate() * force;
        let seen = [back.dot(camera.right), -back.dot(camera.up)];
        let length = force.length().max(1e-12);
        // In proportion to the force as seen from here, but never too short to have a direction.
        let units = (ARROW * length / largest).max(16.0);
        let v = seen.map(|s| s / length * units);
        let l = v[0].hypot(v[1]);
        let _ = write!(
            out,
            "<circle class=\"dtf11\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"5.4\"/>\
             <circle class=\"dtf{ink}\" cx=\"{0:.1}\" cy=\"{1:.1}\" r=\"3.8\"/>",
            from[0], from[1]
        );
        if l > 7.0 {
            let to = [from[0] + v[0], from[1] + v[1]];
            let u = [v[0] / l, v[1] / l];
            let neck = [to[0] - 8.0 * u[0], to[1] - 8.0 * u[1]];
            let head = format!(
                "M{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}z",
                to[0],
                to[1],
                neck[0] - 4.0 * u[1],
                neck[1] + 4.0 * u[0],
                neck[0] + 4.0 * u[1],
                neck[1] - 4.0 * u[0]
            );
            let shaft = format!("M{:.1} {:.1}L{:.1} {:.1}", from[0], from[1], neck[0], neck[1]);
            let _ = write!(
                out,
                "<path class=\"dts11\" fill=\"none\" stroke-width=\"5\" d=\"{shaft}\"/>\
                 <path class=\"dts11\" stroke-width=\"2.5\" d=\"{head}\"/>\
                 <path class=\"dts{ink}\" fill=\"none\" stroke-width=\"3\" d=\"{shaft}\"/>\
                 <path class=\"dtf{ink}\" d=\"{head}\"/>"
            );
        } else {
            // Straight at the eye or away from it.
            let _ = write!(
                out,
                "<circle class=\"dts{ink}\" fill=\"none\" stroke-width=\"2\" cx=\"{:.1}\" \
                 cy=\"{:.1}\" r=\"8\"/>",
                from[0], from[1]
            );
        }
        if i < LISTED {
            // Behind the contact, away from others.
            let u = if l > 1e-9 { [v[0] / l, v[1] / l] } else { [0.0, 1.0] };
            let mut at = [from[0] - 17.0 * u[0], from[1] - 17.0 * u[1]];
            for _ in 0..12 {
                let hit = badges.iter().any(|b| (b[0] - at[0]).hypot(b[1] - at[1]) < 17.0);
                if !hit {
                    break;
                }
                at[1] += 9.0;
            }
            at = [at[0].clamp(10.0, WIDTH - 10.0), at[1].clamp(26.0, HEIGHT - 10.0)];
            badges.push(at);
            let _ = write!(
                out,
                "<circle class=\"dtf{ink} rim\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"8\"/>\
                 <text class=\"dtf11\" x=\"{0:.1}\" y=\"{:.1}\" font-size=\"11\" \
                 font-weight=\"700\" text-anchor=\"middle\">{}</text>",
                at[0],
                at[1],
                at[1] + 4.0,
                i + 1
            );
        }
    }
}

/// The load that goes through the port.
fn port(out: &mut String, poses: &Poses, camera: &Camera, s: &Snapshot) {
    let Some(f) = s.port_n.filter(|f| f.length() > 0.0) else { return };
    let in3 = poses.x_w3.q.conjugate() * (poses.x_w4.q * f);
    let from = camera.at(poses.x_w3.inverse_transform_point(poses.x_w4.p));
    let u = [in3.dot(camera.right) / f.length(), -in3.dot(camera.up) / f.length()];
    let to = [from[0] + 80.0 * u[0], from[1] + 80.0 * u[1]];
    let _ = write!(
        out,
        "<path class=\"dts11\" fill=\"none\" stroke-width=\"6\" d=\"M{:.1} {:.1}L{:.1} {:.1}\"/>\
         <path class=\"dts6\" fill=\"none\" stroke-width=\"3\" stroke-dasharray=\"6 3\" \
         d=\"M{0:.1} {1:.1}L{2:.1} {3:.1}\"/><circle class=\"dtf6\" cx=\"{2:.1}\" cy=\"{3:.1}\" r=\"5\"/>",
        from[0], from[1], to[0], to[1]
    );
}

/// Below the picture: the contacts in words, and what the arrows mean. Gives its height.
fn strip(out: &mut String, run: &Run, m: &Moment, s: &Snapshot, contacts: &[Shown<'_>]) -> f64 {
    const STEP: f64 = FONT + 4.0;
    let mut y = HEIGHT + 10.0;
    for line in lines(contacts) {
        let indent = if line.starts_with(' ') { 26.0 } else { 8.0 };
        text(out, [indent, y], line.trim_start(), "");
        y += STEP;
    }
    if !contacts.is_empty() {
        // A round force for scale.
        let largest = run.strongest().map_or(1.0, |c| c.peak.force_n).max(1e-9);
        let magnitude = 10f64.powf((largest * 0.6).log10().floor());
        let round = [5.0, 2.0, 1.0]
            .into_iter()
            .map(|s| s * magnitude)
            .find(|s| *s <= largest * 0.6)
            .unwrap_or(magnitude);
        let l = ARROW * round / largest;
        let _ = write!(
            out,
            "<path class=\"dts9\" fill=\"none\" stroke-width=\"1.5\" \
             d=\"M8 {:.1}h{l:.1}m-5 -3l5 3l-5 3\"/>",
            y - 4.0
        );
        let words = format!("is {} on the active side", words::newtons(round));
        text(out, [8.0 + l + 8.0, y], &words, "");
        y += STEP;
    }
    if let (true, Some(f)) = (m.port, s.port_n) {
        let _ = write!(
            out,
            "<path class=\"dts6\" fill=\"none\" stroke-width=\"3\" stroke-dasharray=\"6 3\" \
             d=\"M8 {:.1}h30\"/>",
            y - 4.0
        );
        let words = format!("load of the port on the target, {}", words::newtons(f.length()));
        text(out, [46.0, y], &words, "");
        y += STEP;
    }
    y - HEIGHT - 6.0
}

/// The strongest contacts in words, broken where they are too long; a continued line begins with a
/// space.
fn lines(contacts: &[Shown<'_>]) -> Vec<String> {
    let mut out = Vec::new();
    for (i, c) in contacts.iter().take(LISTED).enumerate() {
        let whole = format!("{} · {}", i + 1, c.words);
        if whole.chars().count() <= LINE {
            out.push(whole);
        } else if let Some((a, b)) = whole.split_once(", ") {
            out.extend([format!("{a},"), format!(" {b}")]);
        } else {
            out.push(whole);
        }
    }
    if contacts.len() > LISTED {
        out.push(format!("and {} weaker places", contacts.len() - LISTED));
    }
    if contacts.is_empty() {
        out.push("no contact".to_owned());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_steps_are_written_short() {
        for (v, want) in
            [(0.04, "0"), (-0.04, "0"), (12.0, "12"), (0.5, ".5"), (-0.5, "-.5"), (10.5, "10.5")]
        {
            assert_eq!(short(v), want);
        }
    }
}
