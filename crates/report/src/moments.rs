//! Which moments of a run are worth a picture.

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

/// What the choice is made by; times in s.
#[derive(Clone, Debug, Default)]
pub(crate) struct Facts {
    /// Of the first contact.
    pub(crate) first_contact_s: Option<f64>,
    /// Of the strongest contact, at its peak.
    pub(crate) strongest_s: Option<f64>,
    /// Of closest approach.
    pub(crate) closest_s: Option<f64>,
    pub(crate) latched_s: Vec<Option<f64>>,
    pub(crate) capture_s: Option<f64>,
    /// Of the largest load on the port, where there is one.
    pub(crate) port_load_s: Option<f64>,
    pub(crate) end_s: f64,
    /// Whether the record ends before the run.
    pub(crate) incomplete: bool,
    pub(crate) tick_s: f64,
}

/// The key moments of a run, in order; those closer than a few ticks are one.
pub(crate) fn choose(facts: &Facts) -> Vec<Moment> {
    let mut all: Vec<(f64, String, bool)> = Vec::new();
    let mut add = |t: f64, title: &str, port: bool| all.push((t, title.to_owned(), port));
    let end = facts.end_s;
    if let Some(first) = facts.first_contact_s {
        add((first - 0.1).max(0.0), "before contact", false);
        add(first, "first contact", false);
    } else if let Some(t) = facts.closest_s {
        add(0.0, "start", false);
        add(t, "closest approach", false);
    }
    if let Some(t) = facts.strongest_s {
        add(t, "strongest contact", false);
    }
    for (i, t) in facts.latched_s.iter().enumerate() {
        if let Some(t) = t {
            add(*t, &format!("latch {} catches", i + 1), false);
        }
    }
    if let Some(t) = facts.capture_s {
        add(t, "captured", false);
    }
    if let Some(t) = facts.port_load_s {
        add(t, "largest port load", true);
    }
    add(end, if facts.incomplete { "end of the record" } else { "end" }, false);
    merged(all, facts)
}

/// In order of time, those closer than a few ticks as one, and not too many.
fn merged(mut all: Vec<(f64, String, bool)>, facts: &Facts) -> Vec<Moment> {
    let end = facts.end_s;
    all.retain(|(t, ..)| *t <= end + 1e-9);
    all.sort_by(|a, b| a.0.total_cmp(&b.0));

    let near = 2.5 * facts.tick_s;
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

/// `t = 0.714 s: first contact`
pub(crate) fn heading(m: &Moment, time_s: f64) -> String {
    format!("{} · {}", m.title, words::at(time_s))
}
