//! The page.

use docktwin_record::{FidelityFigures, FidelityOf, Outcome, Verdict};
use docktwin_scenario::{ExpectedOutcome, Scenario};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::curves;
use crate::load::{Largest, Run};
use crate::moments;
use crate::picture::{self, Look};
use crate::story::{self, Contact};
use crate::words;

/// Contacts below this share of the strongest peak are listed apart.
const LIGHT: f64 = 0.05;
/// Most contacts in the chronicle; of the rest the strongest are in the list of light ones.
const MOST: usize = 80;
/// Most light contacts.
const MOST_LIGHT: usize = 400;

const STYLE: &str = include_str!("page.css");

/// The whole page.
pub(crate) fn html(run: &Run) -> String {
    let title = scenario_name(run);
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                // No icon: browsers would ask for one.
                link rel="icon" href="data:,";
                title { (title) " · docktwin report" }
                style { (PreEscaped(docktwin_plot::STYLE)) (PreEscaped(STYLE)) }
            }
            body {
                main {
                    (head(run))
                    (summary(run))
                    (pictures(run))
                    (plots(run))
                    (chronicle(run))
                    (explanation(run))
                }
            }
        }
    }
    .into_string()
}

fn scenario_name(run: &Run) -> String {
    let named = run.summary.as_ref().map(|s| s.scenario.clone());
    named
        .or_else(|| run.metadata.get("scenario").cloned())
        .or_else(|| run.scenario.as_ref().map(|s| s.name.clone()))
        .unwrap_or_else(|| run.name.clone())
}

/// What an outcome means.
fn outcome_words(o: Outcome) -> &'static str {
    match o {
        Outcome::Captured => "The latches hold; the spacecraft are joined.",
        Outcome::Rebounded => "The sides touched and parted again without capture.",
        Outcome::Missed => "The target never came into the zone where the petals guide it.",
        Outcome::Jammed => "The sides stayed in contact, but not all latches caught.",
        Outcome::LimitExceeded => {
            "A load or travel passed a limit of the mechanism, and the run was ended."
        }
        Outcome::Stopped => "The run was stopped.",
    }
}

fn head(run: &Run) -> Markup {
    let decided = run.events.iter().rfind(|e| e.kind == "outcome").map(|e| e.text.clone());
    html! {
        header {
            p.kicker { "docktwin · report of a run" }
            h1 { (scenario_name(run)) }
            @if let Some(s) = &run.scenario { p.lead { (s.description) } }
            @if let Some(why) = &run.incomplete {
                p.warning {
                    strong { @if run.as_recorded { "This run is incomplete. " } @else { "This is not what was recorded. " } }
                    (why)
                }
            }
            @for note in &run.notes { p.note { (note) } }
            section class=(format!("verdict {}", verdict_class(run))) {
                @match &run.summary {
                    Some(s) if !shown_by_log(run) => {
                        p.stamp { span.badge { "not checked" } strong { (s.outcome.to_string().replace('_', " ")) } }
                        p { "So says summary.json, written when the run ended; the log that would show it is not whole." }
                    }
                    Some(s) => {
                        p.stamp {
                            span.badge {
                                @match s.verdict {
                                    Verdict::Pass => "as expected",
                                    Verdict::Fail => "not as expected",
                                    Verdict::Degraded => "degraded",
                                }
                            }
                            strong { (s.outcome.to_string().replace('_', " ")) }
                        }
                        p { (outcome_words(s.outcome)) }
                        @if let Some(text) = decided {
                            p { "Judged: " (sentence(text.split_once(": ").map_or(text.as_str(), |(_, t)| t))) }
                        }
                        @if let Some(reason) = &s.failure_reason {
                            p { "Not as expected because: " (sentence(reason)) }
                        }
                        @for what in &s.warnings { p { strong { "Warning: " } (sentence(what)) } }
                        @if !s.not_judged.is_empty() {
                            p.muted { "Not judged by a run of this kind: " (s.not_judged.join(", ")) "." }
                        }
                    }
                    None => {
                        p.stamp { span.badge { "no verdict" } strong { "outcome unknown" } }
                        p { (so_far(run)) }
                    }
                }
                @if let Some(s) = &run.scenario {
                    p.muted {
                        "Expected: " strong { (expected_outcome(run, s).to_string().replace('_', " ")) }
                        ", because " (s.expect.because)
                    }
                }
            }
        }
    }
}

/// How a run of this kind must end.
fn expected_outcome(run: &Run, scenario: &Scenario) -> ExpectedOutcome {
    let with_rig = run.summary.as_ref().is_some_and(|s| s.loop_.is_some());
    if with_rig { scenario.expect.outcome_of_hil() } else { scenario.expect.outcome }
}

/// Whether the log shows what the summary says.
fn shown_by_log(run: &Run) -> bool {
    run.incomplete.is_none() && run.as_recorded
}

fn verdict_class(run: &Run) -> String {
    let summary = run.summary.as_ref().filter(|_| shown_by_log(run));
    summary.map_or(String::new(), |s| s.verdict.to_string())
}

fn sentence(text: &str) -> String {
    let t = text.trim();
    if t.ends_with(['.', ']', '!']) { t.to_owned() } else { format!("{t}.") }
}

/// What is known of a run without summary.
fn so_far(run: &Run) -> String {
    if run.time_s.is_empty() && run.events.is_empty() {
        return "Nothing of it was read.".to_owned();
    }
    let mut out = Vec::new();
    match run.first_contact_s() {
        Some(t) => out.push(format!("First contact at {}", words::at(t))),
        None => out.push("No contact so far".to_owned()),
    }
    let caught = run.latched_s().iter().flatten().count();
    if caught > 0 {
        out.push(format!("{} caught", words::count(caught, "latch", "latches")));
    }
    if let Some(t) = run.capture_s() {
        out.push(format!("captured at {}", words::at(t)));
    }
    format!("{}.", out.join(", "))
}

fn row(name: &str, value: impl AsRef<str>) -> Markup {
    html! { tr { th scope="row" { (name) } td { (value.as_ref()) } } }
}

fn summary(run: &Run) -> Markup {
    let time = |t: Option<f64>| t.map_or("–".to_owned(), words::at);
    let has_latches = run.has_latches();
    let meta = |k: &str| run.metadata.get(k).cloned();
    html! {
        section {
            h2 { "Summary" }
            div.cards {
                div.card {
                    h3 { "What happened" }
                    table {
                        (row("first contact", time(run.first_contact_s())))
                        @if has_latches {
                            @for (i, t) in run.latched_s().into_iter().enumerate() {
                                (row(&format!("latch {} caught", i + 1), time(t)))
                            }
                            (row("capture", time(run.capture_s())))
                        }
                        @if let Some(s) = &run.summary {
                            (row("largest force between the sides", words::newtons(s.peak_force_n)))
                            (row("largest moment between the sides", format!("{} N·m", words::three(s.peak_moment_nm))))
                            (row("deepest contact", words::metres(s.peak_penetration_m)))
                            (row("impulse between the sides", format!("{} N·s", words::three(s.impulse_ns))))
                        }
                        @if let Some(c) = run.strongest() {
                            (row("strongest contact", strongest(run, c)))
                        }
                        (row("recorded", if run.time_s.is_empty() { "not read".to_owned() } else { format!("{} s", words::three(run.end_s())) }))
                    }
                    @if run.summary.is_some() && !shown_by_log(run) {
                        p.small { "Times, largest values and impulse are those of summary.json; what is left of the log does not show them all." }
                    }
                }
                (loads(run))
                (energy(run))
                (rig_loop(run))
                div.card {
                    h3 { "The run" }
                    table {
                        @if let Some(t) = meta("twin") { (row("twin", t)) }
                        @if let Some(n) = meta("steps_per_tick") {
                            (row("step", step(run, &n)))
                        }
                        (row("ticks read", run.time_s.len().to_string()))
                        @if let Some(s) = &run.summary {
                            (row("computing time", format!("{} s", words::three(s.wall_s))))
                            (row("real-time factor", format!("{} ×", words::three(s.realtime_factor))))
                            (row("time of a step", format!(
                                "{} µs median, {} µs in 99.9 %, {} µs longest",
                                words::three(s.step_us.p50), words::three(s.step_us.p999), words::three(s.step_us.max)
                            )))
                            @if let Some(r) = &s.recording {
                                (row("recording", format!(
                                    "{}, {} lost, {} lost",
                                    words::count(r.ticks, "tick", "ticks"),
                                    words::count(r.dropped_ticks, "tick", "ticks"),
                                    words::count(r.dropped_events, "event", "events"),
                                )))
                            }
                            (row("seed", s.seed.to_string()))
                            (row("docktwin", &s.tool_version))
                        }
                        @for (name, size) in &run.sizes { (row(name, words::bytes(*size))) }
                    }
                }
            }
            (again(run))
        }
    }
}

fn step(run: &Run, n: &str) -> String {
    let count: f64 = n.parse().unwrap_or(f64::NAN);
    format!(
        "{} µs, {n} in a tick of {}",
        words::three(run.tick_s() / count * 1e6),
        words::seconds(run.tick_s())
    )
}

fn strongest(run: &Run, c: &Contact) -> String {
    let pair = run.pairs.get(c.pair).map_or(String::new(), ToString::to_string);
    format!("{}, {pair}, {}", words::newtons(c.peak.force_n), words::at(c.peak.time_s))
}

fn loads(run: &Run) -> Markup {
    let Some(l) = &run.loads else { return no_loads(run) };
    let limits = run.limits();
    type Row = (&'static str, Largest, Option<f64>, &'static str, f64);
    let rows: [Row; 6] = [
        ("compression", l.compression_n, limits.map(|m| m.compression_n), "N", 1.0),
        ("tension", l.tension_n, limits.map(|m| m.tension_n), "N", 1.0),
        ("shear", l.shear_n, limits.map(|m| m.shear_n), "N", 1.0),
        ("torsion", l.torsion_nm, limits.map(|m| m.torsion_nm), "N·m", 1.0),
        ("bending", l.bending_nm, limits.map(|m| m.bending_nm), "N·m", 1.0),
        ("depth", l.depth_m, limits.map(|m| m.depth_m), "mm", 1e3),
    ];
    html! {
        div.card {
            h3 { "Loads on the passive ring" }
            table.loads {
                thead { tr { th { "load" } th { "largest" } th { "limit" } th { "used" } } }
                @for (name, largest, limit, unit, factor) in rows {
                    tr {
                        th scope="row" { (name) }
                        td {
                            (words::three(largest.value * factor)) " " (unit)
                            @if largest.value > 0.0 { span.muted { " at " (words::at(largest.time_s)) } }
                        }
                        td {
                            @if let Some(m) = limit { (words::three(m * factor)) " " (unit) } @else { "–" }
                        }
                        td {
                            @if let Some(m) = limit { (bar(largest.value / m)) } @else { "–" }
                        }
                    }
                }
            }
            p.small {
                @if limits.is_none() { "The model cannot be read, so its limits are not known. " }
                "By ticks; moments about the ring's centre. The summary's figures are by steps and may be larger."
            }
        }
    }
}

/// Loads of what was read only in part would be too small.
fn no_loads(run: &Run) -> Markup {
    if run.incomplete.is_none() {
        return html! {};
    }
    html! {
        div.card {
            h3 { "Loads on the passive ring" }
            p { "Not read: the log is not whole, and the largest load may be where it was not read." }
        }
    }
}

fn bar(share: f64) -> Markup {
    let shown = (share.clamp(0.0, 1.0) * 60.0).max(if share > 0.0 { 1.0 } else { 0.0 });
    let percent = if share >= 0.1 {
        format!("{:.0} %", share * 100.0)
    } else {
        format!("{:.1} %", share * 100.0)
    };
    html! {
        span.bar {
            svg.dtp viewBox="0 0 60 8" width="60" height="8" aria-hidden="true" {
                rect class="dtf10" width="60" height="8" rx="2" {}
                rect class=(if share > 1.0 { "dtf1" } else { "dtf0" }) width=(format!("{shown:.1}")) height="8" rx="2" {}
            }
            span { (percent) }
        }
    }
}

/// A run against a rig: how the loop kept its time, how near it came to the simulated system, and what the
/// supervisor saw.
fn rig_loop(run: &Run) -> Markup {
    let Some((s, l)) = run.summary.as_ref().and_then(|s| Some((s, s.loop_.as_ref()?))) else {
        return html! {};
    };
    let meta = |k: &str| run.metadata.get(k).cloned();
    let us = |x: f64| format!("{} µs", words::three(x));
    let timed = l.lateness_us.max > 0.0;
    html! {
        div.card {
            h3 { "The loop and its rig" }
            table {
                @if let Some(rig) = meta("rig") { (row("rig", rig)) }
                @if let Some(clock) = meta("clock") { (row("clock", clock)) }
                @if let Some(c) = meta("compensator") {
                    (row("against the delay", match meta("lead_s").and_then(|s| s.parse::<f64>().ok()) {
                        Some(lead_s) if c == "lead" => format!("a lead of {} ms", words::three(lead_s * 1e3)),
                        Some(lead_s) if c == "twin" => {
                            format!("two twins and a lead of {} ms", words::three(lead_s * 1e3))
                        }
                        Some(lead_s) if lead_s > 0.0 => format!("{c}, {} ms", words::three(lead_s * 1e3)),
                        _ => c,
                    }))
                }
                @if let Some((c, trust)) = s.compensator.as_ref().and_then(|c| Some((c, c.trust_mean?))) {
                    (row("correction of the wrenches", format!(
                        "{} N RMS at port 4, {} of it applied on average, {} at least; residual {} N RMS{}",
                        c.correction_rms_n.map_or("–".to_owned(), words::three),
                        part(Some(trust)),
                        part(c.trust_min),
                        c.residual_rms_n.map_or("–".to_owned(), words::three),
                        c.fell_back_s.map_or(String::new(), |t| format!("; given up at {} s", words::three(t))),
                    )))
                }
                @if timed {
                    (row("wake-ups late by", format!(
                        "{} median, {} in 99 %, {} latest",
                        us(l.lateness_us.p50), us(l.lateness_us.p99), us(l.lateness_us.max)
                    )))
                }
                (row("left out", words::count(l.missed, "tick", "ticks")))
                @if let Some(f) = &s.fidelity {
                    (row("R_e, R_T", format!("{}, {}", ratio(f.R_e), ratio(f.R_T))))
                    (row("largest force", ratio(f.peak_force_ratio)))
                    (row("force, pose apart", format!("{}, {}", part(f.nrms_force), part(f.nrms_pose))))
                    (row("energy gained", part(f.delta_energy)))
                    @for (name, of) in [("felt", f.felt), ("hardware", f.hardware)] {
                        @if let Some(of) = &of {
                            @for (window, x) in of.windows().into_iter().filter(|w| w.1.window_s.is_some()) {
                                (fidelity_row(&format!("{name}, {}", window.replace('_', " ")), &x, of))
                            }
                        }
                        @if let Some(t) = of.and_then(|of| of.capture_difference_s) {
                            (row(&format!("{name}, capture"), format!("{:+.2} ms", t * 1e3)))
                        }
                    }
                }
                @if let Some(s) = &s.safety {
                    (row("supervisor", if s.trips.is_empty() { s.state.clone() } else { s.trips.join("; ") }))
                    @if let Some((name, x)) = s.min_margin.iter().min_by(|a, b| a.1.total_cmp(b.1)) {
                        (row("least margin", format!("{} of {}", words::three(*x), name.replace('_', " "))))
                    }
                }
            }
            @if s.fidelity.is_some() {
                p.small { "R_e, R_T, force, pose and energy are against the simulated system with the mechanism that the rig has: 1 and 0 % would be it. Felt is what the bodies' programme received, hardware what the article bore. Windows begin with first contact: to the first latch of the simulated system, to 1 s after its capture, to the end. An error of the force is its RMS over the RMS of the simulated force in the same window: where forces are small (grey) a large part is of little." }
            }
        }
    }
}

fn ratio(x: Option<f64>) -> String {
    x.map_or("–".to_owned(), |x| format!("{x:.4}"))
}

fn part(x: Option<f64>) -> String {
    x.map_or("–".to_owned(), |x| format!("{} %", words::three(x * 100.0)))
}

/// A window of a comparison, in grey where its forces are small beside those of the run.
fn fidelity_row(name: &str, x: &FidelityFigures, of: &FidelityOf) -> Markup {
    let small = of.small_forces(x);
    let length = x.window_s.map_or(String::new(), |t| format!("in {}: ", words::seconds(t)));
    let about = small.map_or(String::new(), |[peak, most]| {
        format!(
            "; forces are small here, at most {} of {} in the run",
            words::newtons(peak),
            words::newtons(most)
        )
    });
    let text = format!(
        "{length}peak {}, impulse {}; force {}, moment {}, pose {} apart{about}",
        ratio(x.peak_force_ratio),
        ratio(x.impulse_ratio),
        part(x.nrms_force),
        part(x.nrms_moment),
        part(x.nrms_pose)
    );
    html! { tr class=[small.map(|_| "muted")] { th scope="row" { (name) } td { (text) } } }
}

fn energy(run: &Run) -> Markup {
    let last = |key: &str| -> Option<f64> {
        run.curve(&format!("energy_{key}_j"), 1.0)?.last().map(|p| p[1])
    };
    let kinds = [
        ("kinetic, at the end", "kinetic"),
        ("stored, at the end", "stored"),
        ("lost in the attenuator", "lost_attenuator"),
        ("lost in contacts", "lost_contact"),
        ("lost by friction", "lost_friction"),
        ("lost in the joint", "lost_joint"),
        ("lost at capture", "lost_capture"),
        ("work of thrusters", "work_in"),
    ];
    let on_rig = run.summary.as_ref().is_some_and(|s| s.loop_.is_some());
    html! {
        div.card {
            h3 { "Energy and momentum" }
            table {
                @if let Some(s) = &run.summary {
                    (row("brought in", format!("{} J", words::three(s.energy_in_j))))
                    (row("dissipated", format!("{} J", words::three(s.energy_dissipated_j))))
                }
                @for (name, key) in kinds.into_iter().filter(|_| run.incomplete.is_none()).filter(|k| !on_rig || k.1 == "kinetic" || k.1 == "work_in") {
                    @if let Some(v) = last(key) { (row(name, format!("{} J", words::three(v)))) }
                }
                @if let Some(s) = &run.summary {
                    @if !on_rig {
                        (row("account off by", format!("{} of what came in", words::exponent(s.energy_balance_error))))
                    }
                    (row("momentum off by", words::exponent(s.momentum_error)))
                }
            }
            @if on_rig {
                p.small { "Of both spacecraft by the forces measured: on a rig nothing tells where energy went, and what both sensors' zeros are off, or a ring keeps for itself, is missing in the momentum." }
            }
        }
    }
}

fn again(run: &Run) -> Markup {
    let dir = run.dir.display().to_string();
    let digests: Vec<(&String, &String)> = run
        .metadata
        .iter()
        .filter(|(_, v)| v.len() == 32 && v.chars().all(|c| c.is_ascii_hexdigit()))
        .collect();
    html! {
        div.card.wide {
            h3 { "Run it again" }
            @if !docktwin_record::repeats(&run.metadata) {
                p.small { "A run in real time, or against a rig in another process, does not repeat bit by bit. Run the scenario again and see how far apart both are:" }
                pre { code { "docktwin diff " (quoted(&dir)) " OTHER-RUN --tolerance 1e-2 --align first-contact" } }
            } @else if run.incomplete.is_none() {
                pre { code { "docktwin replay " (quoted(&dir)) } }
                p.small { "runs it tick by tick and compares every bit." }
            } @else {
                p.small { "An incomplete run can be replayed up to where its log ends:" }
                pre { code { "docktwin replay " (quoted(&dir)) } }
            }
            @if let Some(s) = &run.summary {
                p.small { "State digest: " code { (s.state_digest) } " (equal digests: equal in every bit of every state)" }
            }
            @if !digests.is_empty() {
                details {
                    summary { "Digests of the files it was made from" }
                    table.digests { @for (k, v) in digests { tr { th scope="row" { (k) } td { code { (v) } } } } }
                }
            }
        }
    }
}

/// For a shell.
fn quoted(path: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@".contains(c);
    if !path.is_empty() && path.chars().all(plain) {
        path.to_owned()
    } else {
        format!("'{}'", path.replace('\'', "'\\''"))
    }
}

fn pictures(run: &Run) -> Markup {
    html! {
        section {
            h2 { "Key moments" }
            @match (&run.geometry, &run.no_pictures) {
                (Some(g), None) => {
                    p.small {
                        "The mechanism as modelled, in the poses of the record: active side "
                        span.ta { "orange" } ", passive side " span.tp { "blue" }
                        ". A dot is a contact; its arrow is the force on the active side, and its number leads to the words below. "
                        "Contacts lie on top, so that none is hidden."
                    }
                    @for (m, s) in &run.moments {
                        figure.moment {
                            h3 { (moments::heading(m, s.time_s)) }
                            div.views {
                                (PreEscaped(picture::svg(run, g, m, s, Look::Oblique)))
                                (PreEscaped(picture::svg(run, g, m, s, Look::Axis)))
                            }
                            @let all = picture::caption(run, s);
                            @if all.len() > 5 {
                                figcaption { (all.len()) " places touch; the five strongest are named." }
                            }
                        }
                    }
                    @if run.moments.is_empty() { p { "No tick of the record could be drawn." } }
                }
                (_, why) => {
                    p.note {
                        "No pictures: " (why.as_deref().unwrap_or("the models are not there")) ". "
                        "Put the model files back to where scenario.toml names them and make the report again."
                    }
                }
            }
        }
    }
}

fn plots(run: &Run) -> Markup {
    let near = curves::interesting(run);
    html! {
        section {
            h2 { "Plots" }
            @match curves::draw(run) {
                Err(e) => p.note { "The plots could not be drawn: " (e) "." },
                Ok((plots, zero)) => {
                    @if plots.is_empty() {
                        p.note { "The record has too few ticks for plots." }
                    } @else if plots.iter().any(|p| p.whole.is_some()) {
                        p.small {
                            "First the interesting span, " (format!("{:.2}", near.start)) " to "
                            (format!("{:.2} s", near.end)) ", then the whole run with that span shaded. "
                            "Every peak of the record is kept."
                        }
                    }
                    @for p in &plots {
                        div class=(if p.whole.is_none() { "plot alone" } else { "plot" }) {
                            div.w { (PreEscaped(&p.wide)) }
                            div.n { (PreEscaped(&p.narrow)) }
                            @if let Some(whole) = &p.whole { div.all { (PreEscaped(whole)) } }
                        }
                    }
                    @if !zero.is_empty() {
                        p.small { "Zero throughout, or not recorded: " (zero.join("; ")) "." }
                    }
                }
            }
        }
    }
}

fn chronicle(run: &Run) -> Markup {
    let largest = run.strongest().map_or(0.0, |c| c.peak.force_n);
    let heavy = |c: &&Contact| c.peak.force_n >= LIGHT * largest;
    let mut main: Vec<&Contact> = run.contacts.iter().filter(heavy).collect();
    let mut light: Vec<&Contact> = run.contacts.iter().filter(|c| !heavy(c)).collect();
    if main.len() > MOST {
        main.sort_by(|a, b| b.peak.force_n.total_cmp(&a.peak.force_n));
        light.extend(main.split_off(MOST));
        main.sort_by(|a, b| a.begin_s.total_cmp(&b.begin_s));
    }
    let left_out = light.len().saturating_sub(MOST_LIGHT);
    if left_out > 0 {
        light.sort_by(|a, b| b.peak.force_n.total_cmp(&a.peak.force_n));
        light.truncate(MOST_LIGHT);
    }
    light.sort_by(|a, b| a.begin_s.total_cmp(&b.begin_s));
    html! {
        section {
            h2 { "Contacts in words" }
            @if run.contacts.is_empty() {
                p { @if run.time_s.is_empty() { "No tick was read." } @else if run.incomplete.is_some() { "Nothing touched in what was read." } @else { "Nothing touched." } }
            } @else {
                p.small {
                    (words::count(run.contacts.len(), "contact", "contacts"))
                    ". Touches of one pair less than " (words::seconds(story::CHATTER_S))
                    " apart count as one contact. Peaks are normal forces at ticks. Directions are those of the active surface over the passive one."
                }
                ol.chronicle { @for c in &main { (entry(run, c)) } }
                @if !light.is_empty() {
                    details {
                        summary {
                            (words::count(light.len() + left_out, "lighter contact", "lighter contacts"))
                            ", none above "
                            (words::newtons(light.iter().map(|c| c.peak.force_n).fold(0.0, f64::max)))
                        }
                        ol.chronicle { @for c in &light { (entry(run, c)) } }
                        @if left_out > 0 { p.small { "The weakest " (left_out) " are not listed." } }
                    }
                }
            }
            @let events: Vec<_> = run.events.iter().filter(|e| !e.kind.starts_with("contact_")).collect();
            @if !events.is_empty() {
                h3 { "Other events" }
                ol.events {
                    @for e in events { li { span.t { (words::at(e.time_s)) } " " (event_text(&e.text)) } }
                }
            }
        }
    }
}

/// Without the time that stands before it.
fn event_text(text: &str) -> &str {
    match text.strip_prefix("t = ").and_then(|t| t.split_once(" s ")) {
        Some((number, rest)) if number.parse::<f64>().is_ok() => rest,
        _ => text,
    }
}

fn entry(run: &Run, c: &Contact) -> Markup {
    let Some(pair) = run.pairs.get(c.pair) else { return html! {} };
    let kind = pair.kind();
    html! {
        li class=(format!("k{kind}")) {
            p {
                span.t { "t = " (words::at(c.begin_s)) } " "
                strong { (story::meeting(c, pair, run.geometry.as_ref())) }
                ", peak " strong { (words::newtons(c.peak.force_n)) } " at " (words::at(c.peak.time_s))
                @if let Some(s) = story::peak_sliding(c) { ", " (s) }
                "."
            }
            p.small { (story::figures(c)) }
        }
    }
}

fn explanation(run: &Run) -> Markup {
    let m = run.geometry.as_ref().map(|g| &g.mechanism);
    html! {
        section.explain {
            h2 { "Terms and frames" }
            dl {
                dt { "Active and passive side, A and P" }
                dd { "The chaser carries the active side: a ring on an attenuator, with petals A1, A2, … and latches. The target carries the passive side, fixed, with petals P1, P2, … Events and the record write P2 as 2'." }
                dt { "Frames" }
                dd {
                    "e3 is the chaser's port, e4 the target's; +X of both is the docking axis from chaser to target. Docked, both have the same axes. "
                    @if let Some(m) = m { "Then their origins are " (words::metres(m.docked_length_m())) " apart along X. " }
                    "Relative positions are those of e4 in e3. Relative velocity is that of the target's ring centre against the chaser, in e3; closing is X < 0. Roll, pitch and yaw turn about X, Y and Z."
                }
                dt { "Inward, forward, clockwise" }
                dd { "Inward is toward the docking axis, forward is along it toward the target, clockwise is as seen from the chaser. Slower than 1 mm/s counts as sticking." }
                dt { "Place" }
                dd { "“Between petals P1 and P2” is where on the other ring the touch is. Near the base, halfway up, near the tip: thirds of the petal's height." }
                dt { "Normal force, depth, impulse" }
                dd { "The force across the surfaces; how far they overlap in the model, a measure of their compression; the normal force summed over time. A pair that touches at two places counts with both." }
                dt { "Port loads" }
                dd { "F3 and M3 act on the chaser at e3, F4 and M4 on the target at e4. Compression pushes the sides together, tension pulls them apart; after capture the joined rings carry load without a contact." }
                dt { "Latches" }
                dd { "Free; near its striker; struck; caught. Three caught latches are a capture, or those that the mechanism names." }
                dt { "Attenuator" }
                dd { "What carries the active ring: springs and brakes. Deflection is how far the ring is from its rest, in e3." }
                dt { "Account off by" }
                dd { "What the energy account fails to close by, over what was brought in: the check on the computation itself." }
            }
            p.small { "Written by docktwin " (env!("CARGO_PKG_VERSION")) " from " code { (run.dir.display()) } "." }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_paths_are_quoted_for_a_shell() {
        assert_eq!(quoted("runs/a-1"), "runs/a-1");
        assert_eq!(quoted("my run's"), "'my run'\\''s'");
    }

    #[test]
    fn oracle_event_texts_lose_their_time_only() {
        assert_eq!(event_text("t = 0.824 s latch 3 approaches"), "latch 3 approaches");
        assert_eq!(event_text("captured: all s hold"), "captured: all s hold");
    }
}
