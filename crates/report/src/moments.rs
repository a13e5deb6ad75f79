//! Which moments of a run are worth a picture.

use crate::load::Run;
use crate::words;

/// At most this many pictures.
const MOST: usize = 8;

/// A moment to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moment {
    pub(crate) time_s: f64,
    pub(crate) title: String,
    /// Whether the load on the port is drawn too.
    pub(crate) port: bool,
}

/// The key moments of a run, in order; those closer than a few ticks are one.
pub(crate) fn choose(run: &Run) -> Vec<Moment> {
    let mut all: Vec<(f64, String, bool)> = Vec::new();
    let mut add = |t: f64, title: &str, port: bool| all.push((t, title.to_owned(), port));
    let end = run.end_s();
    if let Some(first) = run.contacts.first() {
        add((first.begin_s - 0.1).max(0.0), "before contact", false);
        add(first.begin_s, "first contact", false);
    } else if let Some(t) = closest(run) {
        add(0.0, "start", false);
        add(t, "closest approach", false);
    }
    if let Some(c) = run.strongest() {
        add(c.peak.time_s, "strongest contact", false);
    }
    for (i, t) in run.latched_s().iter().enumerate() {
        if let Some(t) = t {
            add(*t, &format!("latch {} catches", i + 1), false);
        }
    }
    if let Some(t) = run.capture_s() {
        add(t, "captured", false);
    }
    let port = run.loads.map(|l| l.force_n).filter(|l| l.value > 1.0);
    if let Some(l) = port {
        add(l.time_s, "largest port load", true);
    }
    add(end, if run.incomplete.is_some() { "end of the record" } else { "end" }, false);
    all.retain(|(t, ..)| *t <= end + 1e-9);
    all.sort_by(|a, b| a.0.total_cmp(&b.0));

    let near = 2.5 * run.tick_s();
    let mut out: Vec<Moment> = Vec::new();
    for (time_s, title, port) in all {
        match out.last_mut() {
            Some(last) if time_s - last.time_s <= near => {
                last.title = format!("{}, {title}", last.title);
                last.port |= port;
                // Latch and capture are there at the end of their tick.
                if !last.title.contains("contact") {
                    last.time_s = time_s;
                }
            }
            _ => out.push(Moment { time_s, title, port }),
        }
    }
    while out.len() > MOST {
        // The two middle latches tell least.
        let i = out.iter().rposition(|m| m.title.starts_with("latch")).unwrap_or(1);
        out.remove(i);
    }
    for m in &mut out {
        let mut c = m.title.chars();
        if let Some(first) = c.next() {
            m.title = first.to_uppercase().chain(c).collect();
        }
    }
    out
}

fn closest(run: &Run) -> Option<f64> {
    let axis = |a: &str| run.curve(&format!("relative_position_{a}_m"), 1.0);
    let (x, y, z) = (axis("x")?, axis("y")?, axis("z")?);
    let far = |i: usize| x[i][1].hypot(y[i][1]).hypot(z[i][1]);
    (0..x.len()).min_by(|a, b| far(*a).total_cmp(&far(*b))).map(|i| x[i][0])
}

/// `t = 0.714 s: first contact`
pub(crate) fn heading(m: &Moment, time_s: f64) -> String {
    format!("{} · {}", m.title, words::at(time_s))
}
