//! `doctor`: what this machine offers a real-time loop.

use std::{
    fs,
    path::Path,
    process::{Command, ExitCode, Stdio},
    thread,
};

use clap::Args;
use docktwin_hil::{
    clock::{Clock as _, ClockCounts, OverrunPolicy, RealtimeClock},
    histogram::{Latencies, LatencyHistogram},
    realtime::{RealtimeReport, RealtimeSetup, Rights, Shortage, Step, relax, timer_resolution_ns},
};
use docktwin_view::VIEWER_VERSION;
use serde_json::{Value, json};

use crate::{
    failure::{Failure, OTHERWISE},
    view::Viewer,
};

pub(crate) const EXAMPLES: &str = "\
A loop of 1 kHz that does nothing is run for the given time, with the priority and the locked
memory that a real one asks for, and how late it wakes up is measured; then cyclictest for as long,
where it is installed (sudo apt install rt-tests).

Exit codes: 0 a loop can run in real time; 1 only as best effort (`--allow-best-effort`).

Examples:
  docktwin doctor
  docktwin doctor --seconds 60          the rare late wake-ups too
  sudo docktwin doctor                  what more rights would give
  docktwin doctor --json";

/// Options of `doctor`.
#[derive(Debug, Args)]
pub(crate) struct DoctorArgs {
    /// How long to measure, s
    #[arg(
        long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=3600)
    )]
    seconds: u32,
}

/// Period of the loop that is measured, ns.
const PERIOD_NS: u64 = 1_000_000;
/// So late may 99 of 100 wake-ups be, ns: a quarter of the period, the rest is for the work.
const P99_LIMIT_NS: u64 = PERIOD_NS / 4;

/// How something stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// As it should be.
    Good,
    /// A loop runs, less well than it could.
    Doubtful,
    /// A loop runs as best effort only.
    Lacking,
}

impl State {
    const fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Doubtful => "doubtful",
            Self::Lacking => "lacking",
        }
    }
}

/// One thing looked at.
struct Check {
    name: &'static str,
    state: State,
    found: String,
    /// What it costs, and the command that mends it.
    mend: Option<(String, String)>,
}

impl Check {
    fn good(name: &'static str, found: impl Into<String>) -> Self {
        Self { name, state: State::Good, found: found.into(), mend: None }
    }

    fn short(
        state: State,
        name: &'static str,
        found: impl Into<String>,
        cost: &str,
        remedy: impl Into<String>,
    ) -> Self {
        let mend = Some((cost.to_owned(), remedy.into()));
        Self { name, state, found: found.into(), mend }
    }

    fn json(&self) -> Value {
        let (cost, remedy) = self.mend.as_ref().map_or((None, None), |(c, r)| (Some(c), Some(r)));
        json!({
            "name": self.name, "state": self.state.word(), "found": self.found,
            "cost": cost, "remedy": remedy,
        })
    }

    fn print(&self) {
        println!("{:<9} {:<16} {}", self.state.word(), self.name, self.found);
        if let Some((cost, remedy)) = &self.mend {
            println!("          {:<16} costs: {cost}", "");
            println!("          {:<16} mend:  {remedy}", "");
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &DoctorArgs, json: bool) -> Result<ExitCode, Failure> {
    if !json {
        eprintln!("measuring for {} s …", args.seconds);
    }
    let measured = measure(args.seconds)?;
    let cyclic = cyclictest(args.seconds, &measured.report);
    let mut checks = vec![kernel(), machine()];
    checks.extend(rights(&measured.report));
    checks.push(throttling());
    checks.extend(cores());
    checks.extend([governor(), idle(), timer(), clock_source()]);
    checks.push(measured.check());
    checks.push(shared_memory());
    checks.push(viewer());
    let best_effort = checks.iter().any(|c| c.state == State::Lacking);
    let code = if best_effort { OTHERWISE } else { 0 };
    if json {
        println!("{}", as_json(&checks, &measured, &cyclic, best_effort, code));
    } else {
        checks.iter().for_each(Check::print);
        measured.print(&cyclic);
        println!("{}", verdict(best_effort));
    }
    Ok(ExitCode::from(code))
}

fn verdict(best_effort: bool) -> &'static str {
    if best_effort {
        "best effort only: a loop is refused what is lacking above, and runs with --allow-best-effort"
    } else {
        "a loop can run in real time on this machine"
    }
}

#[expect(clippy::cast_precision_loss, reason = "times far below 2^53 ns")]
fn micros(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

fn as_json(
    checks: &[Check],
    measured: &Measured,
    cyclic: &Result<u64, String>,
    best_effort: bool,
    code: u8,
) -> Value {
    let l = &measured.latencies;
    json!({
        "checks": checks.iter().map(Check::json).collect::<Vec<_>>(),
        "period_us": micros(PERIOD_NS),
        "wakeup_us": {
            "p50": micros(l.p50_ns), "p99": micros(l.p99_ns), "p999": micros(l.p999_ns),
            "max": micros(l.max_ns), "n": l.n,
        },
        "missed": measured.counts.missed,
        "histogram_us": measured.bars.iter().map(|(to, n)| json!([micros(*to), n])).collect::<Vec<_>>(),
        "cyclictest_p99_us": cyclic.as_ref().ok().map(|ns| micros(*ns)),
        "p99_ratio": cyclic.as_ref().ok().map(|ns| measured.ratio(*ns)),
        "verdict": if best_effort { "best_effort" } else { "real_time" },
        "exit_code": code,
    })
}

/// What the idle loop saw.
struct Measured {
    report: RealtimeReport,
    latencies: Latencies,
    counts: ClockCounts,
    /// Upper edges, powers of two of 1 µs, ns, and how many wake-ups below them.
    bars: Vec<(u64, u64)>,
}

/// Runs the idle loop in a thread of its own, because it asks for priority.
fn measure(seconds: u32) -> Result<Measured, Failure> {
    let loop_ = move || {
        let mut lateness = LatencyHistogram::new();
        let report = RealtimeSetup::default().apply(Shortage::BestEffort).unwrap_or_default();
        let mut clock = RealtimeClock::new(PERIOD_NS, OverrunPolicy::Skip);
        clock.start();
        let ticks = u64::from(seconds) * 1_000_000_000 / PERIOD_NS;
        loop {
            let wakeup = clock.wait();
            lateness.record_ns(wakeup.lateness_ns);
            if wakeup.tick + 1 >= ticks {
                break;
            }
        }
        relax();
        let mut bars: Vec<(u64, u64)> = Vec::new();
        for (ns, n) in lateness.cells() {
            let edge = 1000 * ns.div_ceil(1000).max(1).next_power_of_two();
            match bars.last_mut() {
                Some(last) if last.0 == edge => last.1 += n,
                _ => bars.push((edge, n)),
            }
        }
        Measured { report, latencies: lateness.latencies(), counts: clock.counts(), bars }
    };
    let cannot = |what: String| Failure::Usage {
        what,
        remedy: "close other programs, then measure again".to_owned(),
    };
    let thread = thread::Builder::new()
        .spawn(loop_)
        .map_err(|e| cannot(format!("cannot start a thread to measure in: {e}")))?;
    thread.join().map_err(|_| cannot("the measurement broke off".to_owned()))
}

impl Measured {
    fn check(&self) -> Check {
        let (l, name) = (&self.latencies, "wake-ups");
        let found = format!(
            "late by p50 {:.1} µs, p99 {:.1} µs, p99.9 {:.1} µs, max {:.1} µs, n {}; {} ticks missed",
            micros(l.p50_ns),
            micros(l.p99_ns),
            micros(l.p999_ns),
            micros(l.max_ns),
            l.n,
            self.counts.missed
        );
        let remedy = "end other programs, mend what stands above, measure again: docktwin doctor";
        if l.p99_ns > P99_LIMIT_NS {
            let cost = "one tick in a hundred begins more than a quarter of a period late";
            return Check::short(State::Lacking, name, found, cost, remedy);
        }
        if self.counts.missed > 0 {
            let cost = "ticks without a command: a rig holds the one before";
            return Check::short(State::Doubtful, name, found, cost, remedy);
        }
        Check::good(name, found)
    }

    /// Our p99 as a multiple of that of cyclictest.
    fn ratio(&self, cyclic_ns: u64) -> f64 {
        micros(self.latencies.p99_ns) / micros(cyclic_ns.max(1))
    }

    fn print(&self, cyclic: &Result<u64, String>) {
        println!("lateness of {} wake-ups at 1 kHz", self.latencies.n);
        let most = self.bars.iter().map(|(_, n)| *n).max().unwrap_or(1);
        for (edge, n) in &self.bars {
            // One mark at least: the rare late ones are what matters.
            let marks = usize::try_from((n * 40).div_ceil(most)).unwrap_or(0);
            println!("  up to {:>7} µs  {n:>8}  {}", edge / 1000, "#".repeat(marks));
        }
        match cyclic {
            Ok(ns) => println!(
                "cyclictest: p99 {:.0} µs (in whole µs); ours is {:.2} times that",
                micros(*ns),
                self.ratio(*ns)
            ),
            Err(why) => println!("{why}"),
        }
    }
}

/// p99 of cyclictest's wake-ups, ns, with the rights that our loop got.
///
/// # Errors
/// Why there is none, as a sentence.
fn cyclictest(seconds: u32, report: &RealtimeReport) -> Result<u64, String> {
    let mut c = Command::new("cyclictest");
    c.args(["--quiet", "--threads=1", "--interval=1000", "--histogram=100000"]);
    c.arg(format!("--duration={seconds}"));
    if report.granted.contains(&Step::Priority) {
        c.arg("--priority=80");
    }
    if report.granted.contains(&Step::Memory) {
        c.arg("--mlockall");
    }
    let said = c.stdin(Stdio::null()).output().map_err(|e| {
        format!("cyclictest, to compare with, cannot be started ({e}): sudo apt install rt-tests")
    })?;
    p99_of_histogram(&String::from_utf8_lossy(&said.stdout)).ok_or_else(|| {
        let why = String::from_utf8_lossy(&said.stderr);
        let why = why.lines().find(|l| !l.trim().is_empty()).unwrap_or("it says nothing");
        format!("cyclictest, to compare with, does not measure: {why}")
    })
}

/// From lines of "µs count"; everything else is a comment.
fn p99_of_histogram(text: &str) -> Option<u64> {
    let cells: Vec<(u64, u64)> = text
        .lines()
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            let cell = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
            words.next().is_none().then_some(cell)
        })
        .collect();
    let all: u64 = cells.iter().map(|(_, n)| n).sum();
    let mut below = 0;
    cells.into_iter().find_map(|(us, n)| {
        below += n;
        (n > 0 && below * 100 >= all * 99).then_some(us * 1000)
    })
}

/// A file of the kernel, without the line's end.
fn kernel_file(path: impl AsRef<Path>) -> Option<String> {
    fs::read_to_string(path).ok().map(|t| t.trim().to_owned())
}

fn kernel() -> Check {
    let name = "kernel";
    let release = kernel_file("/proc/sys/kernel/osrelease").unwrap_or_else(|| "unknown".to_owned());
    let build = kernel_file("/proc/sys/kernel/version").unwrap_or_default();
    let words: Vec<&str> = build.split_whitespace().filter(|w| w.starts_with("PREEMPT")).collect();
    let kind = words.first().copied().unwrap_or("no preemption");
    let found = format!("{release}, {kind}");
    if kind == "PREEMPT_RT" || kernel_file("/sys/kernel/realtime").as_deref() == Some("1") {
        return Check::good(name, found);
    }
    Check::short(
        State::Doubtful,
        name,
        found,
        "the kernel itself may hold the loop up, now and then by milliseconds",
        "Debian: sudo apt install linux-image-rt-amd64, Ubuntu: sudo pro enable realtime-kernel; \
         then start the machine anew",
    )
}

fn machine() -> Check {
    let name = "machine";
    let flags = kernel_file("/proc/cpuinfo").unwrap_or_default();
    if !flags.split_whitespace().any(|w| w == "hypervisor") {
        return Check::good(name, "no other system between kernel and cores");
    }
    Check::short(
        State::Doubtful,
        name,
        "a virtual machine",
        "its host may take the cores away, now and then by milliseconds",
        "for a rig of steel: run on the machine itself; otherwise pin its virtual cores on the host: \
         virsh vcpupin …",
    )
}

/// What the measuring thread was given, and was not.
fn rights(report: &RealtimeReport) -> Vec<Check> {
    let name = |step| match step {
        Step::Priority => "priority",
        Step::Memory => "locked memory",
        Step::Affinity => "core",
        Step::TimerSlack => "timer slack",
    };
    let given = |step| match step {
        Step::Priority => "SCHED_FIFO is granted",
        Step::Memory => "all memory may be locked",
        Step::Affinity => "a core is granted",
        Step::TimerSlack => "1 ns",
    };
    let granted = report.granted.iter().map(|s| Check::good(name(*s), given(*s)));
    let short = report.shortfalls.iter().map(|s| {
        Check::short(State::Lacking, name(s.step), s.what.clone(), s.step.cost(), s.remedy.clone())
    });
    granted.chain(short).collect()
}

fn throttling() -> Check {
    let name = "throttling";
    let number = |file: &str| kernel_file(file).and_then(|t| t.parse::<i64>().ok());
    let runtime = number("/proc/sys/kernel/sched_rt_runtime_us");
    let period = number("/proc/sys/kernel/sched_rt_period_us").unwrap_or(1_000_000);
    match runtime {
        Some(0) => Check::short(
            State::Lacking,
            name,
            "real-time threads get no time at all",
            "a loop with priority would never run",
            "sudo sysctl -w kernel.sched_rt_runtime_us=950000",
        ),
        Some(us) if us > 0 => Check::good(
            name,
            format!("real-time threads get {us} of {period} µs; a loop stays far below"),
        ),
        _ => Check::good(name, "real-time threads are not held back"),
    }
}

fn cores() -> Vec<Check> {
    let allowed = Rights::read().cores.len();
    let isolated = kernel_file("/sys/devices/system/cpu/isolated").unwrap_or_default();
    let count = if allowed >= 2 {
        Check::good("cores", format!("{allowed} for this process"))
    } else {
        Check::short(
            State::Doubtful,
            "cores",
            "1 for this process",
            "loop, rig, recording and viewer take turns",
            "give the process, container or virtual machine two cores or more: taskset -c 0,1 …",
        )
    };
    let last = allowed.saturating_sub(1);
    let isolation = if isolated.is_empty() {
        Check::short(
            State::Doubtful,
            "isolation",
            "no core is kept free of other work",
            "interrupts and other threads come between, some 10 to 100 µs each",
            format!(
                "add `isolcpus=managed_irq,domain,{last} nohz_full={last} rcu_nocbs={last}` to \
                 GRUB_CMDLINE_LINUX of /etc/default/grub, then: sudo update-grub && sudo reboot; \
                 give the loop that core"
            ),
        )
    } else {
        Check::good("isolation", format!("cores kept free of other work: {isolated}"))
    };
    vec![count, isolation]
}

/// Words that a file of every core holds, each once.
fn of_cores(file: &str) -> Vec<String> {
    let mut out: Vec<String> = Rights::read()
        .cores
        .iter()
        .filter_map(|c| kernel_file(format!("/sys/devices/system/cpu/cpu{c}/{file}")))
        .collect();
    out.sort_unstable();
    out.dedup();
    out
}

fn governor() -> Check {
    let name = "governor";
    let all = of_cores("cpufreq/scaling_governor");
    if all.is_empty() {
        return Check::good(name, "the clock rate of the cores is not ours to set");
    }
    let found = all.join(", ");
    if all == ["performance"] {
        return Check::good(name, found);
    }
    Check::short(
        State::Doubtful,
        name,
        found,
        "after a pause a core is slow at first, some 10 to 100 µs",
        "sudo cpupower frequency-set -g performance",
    )
}

/// Longest way out of an idle state that a core may take, µs.
const IDLE_LIMIT_US: u64 = 20;

fn idle() -> Check {
    let name = "idle states";
    let states = (0..16).filter_map(|i| {
        let file = |name: &str| {
            let path = format!("/sys/devices/system/cpu/cpu0/cpuidle/state{i}/{name}");
            kernel_file(path)?.parse::<u64>().ok()
        };
        file("latency").filter(|_| file("disable") != Some(1))
    });
    match states.max() {
        None => Check::good(name, "none that the kernel sets"),
        Some(us) if us <= IDLE_LIMIT_US => Check::good(name, format!("left within {us} µs")),
        Some(us) => Check::short(
            State::Doubtful,
            name,
            format!("the deepest is left within {us} µs"),
            "a core that slept wakes the loop that much later",
            format!("sudo cpupower idle-set -D {IDLE_LIMIT_US}"),
        ),
    }
}

fn timer() -> Check {
    let (ns, name) = (timer_resolution_ns(), "timer");
    let found = format!("resolution {ns} ns");
    if ns <= 1000 {
        return Check::good(name, found);
    }
    Check::short(
        State::Lacking,
        name,
        found,
        "wake-ups come at ticks of the kernel, 1 to 10 ms apart",
        "start the kernel without highres=off, or take one built with CONFIG_HIGH_RES_TIMERS=y",
    )
}

fn clock_source() -> Check {
    let name = "clock source";
    let folder = "/sys/devices/system/clocksource/clocksource0";
    let now = kernel_file(format!("{folder}/current_clocksource"));
    let now = now.unwrap_or_else(|| "unknown".to_owned());
    if !["hpet", "acpi_pm", "jiffies", "pit"].contains(&now.as_str()) {
        return Check::good(name, now);
    }
    let others =
        kernel_file(format!("{folder}/available_clocksource")).unwrap_or_else(|| now.clone());
    let remedy = if others.split_whitespace().any(|o| o == "tsc") {
        format!("echo tsc | sudo tee {folder}/current_clocksource")
    } else {
        "look why the kernel left tsc: sudo dmesg | grep -i tsc".to_owned()
    };
    let cost = "every reading of the clock is a slow call, 1 µs and more";
    Check::short(State::Doubtful, name, format!("{now} (there are: {others})"), cost, remedy)
}

/// Where iceoryx2 keeps the memory that loop and rig share and the names of its services, and what
/// opens it.
const SHARED: [(&str, &str); 2] = [
    (
        "/dev/shm",
        "sudo mount -t tmpfs -o mode=1777 tmpfs /dev/shm, in a container: docker run --ipc=host",
    ),
    (
        "/tmp/iceoryx2",
        "run loop and rig as one user; left by another one, with none of its programs running: sudo \
         rm -r /tmp/iceoryx2",
    ),
];

fn shared_memory() -> Check {
    let name = "shared memory";
    let closed: Vec<(String, &str)> = SHARED
        .iter()
        .filter_map(|(folder, remedy)| Some((writable(Path::new(folder)).err()?, *remedy)))
        .collect();
    if closed.is_empty() {
        let [(a, _), (b, _)] = SHARED;
        return Check::good(name, format!("{a} and {b} can be written"));
    }
    let (found, remedies): (Vec<String>, Vec<&str>) = closed.into_iter().unzip();
    Check::short(
        State::Lacking,
        name,
        found.join("; "),
        "no rig in another process can be reached (--rig ipc:NAME)",
        remedies.join("; "),
    )
}

/// Writes a file into the folder, or into the one it will be made in, and removes it.
fn writable(folder: &Path) -> Result<(), String> {
    let there = if folder.is_dir() { folder } else { folder.parent().unwrap_or(folder) };
    let file = there.join(format!("docktwin-doctor-{}", std::process::id()));
    let done = fs::write(&file, [0_u8; 4096]).map_err(|e| format!("{}: {e}", there.display()));
    // What could not be written need not be removed.
    let _ = fs::remove_file(&file);
    done
}

fn viewer() -> Check {
    let name = "viewer";
    match Viewer::find(None) {
        Ok(v) => Check::good(name, format!("{} {VIEWER_VERSION}", v.program().display())),
        Err(Failure::Usage { what, remedy }) => Check::short(
            State::Doubtful,
            name,
            what,
            "no picture of a run, live or afterwards",
            remedy.lines().next().unwrap_or_default(),
        ),
        Err(e) => Check::short(State::Doubtful, name, e.to_string(), "no picture of a run", ""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_p99_of_what_cyclictest_writes() {
        let text = "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000001\t000050\n\
                    000002\t000048\n000003\t000001\n000009\t000001\n# Total: 000000100\n";
        assert_eq!(p99_of_histogram(text), Some(3000));
        assert_eq!(p99_of_histogram("# nothing\n"), None);
    }

    #[test]
    fn invariant_a_folder_that_is_not_there_counts_as_its_parent() {
        let at = tempfile::tempdir().expect("a folder");
        assert_eq!(writable(&at.path().join("later")), Ok(()));
        assert!(writable(Path::new("/proc/none")).is_err());
        assert_eq!(fs::read_dir(at.path()).expect("a folder").count(), 0, "left nothing behind");
    }
}
