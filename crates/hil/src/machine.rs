//! What a machine offers a real-time loop: kernel, rights, cores, clocks, shared memory, and a loop that
//! does nothing, measured. Each shortfall comes with what it costs and what mends it.
//!
//! ```no_run
//! use docktwin_hil::machine::{State, examine, measure};
//!
//! let measured = measure(5)?;
//! let checks = examine(&measured);
//! let real_time = checks.iter().all(|c| c.state != State::Lacking);
//! println!("p99 {} ns late, {real_time}", measured.latencies.p99_ns);
//! # Ok::<(), docktwin_hil::machine::MeasureError>(())
//! ```

mod wakeups;

use std::{fs, path::Path};

use crate::realtime::{RealtimeReport, Rights, Step, timer_resolution_ns};

pub use self::wakeups::{
    MeasureError, Measured, NoCyclictest, PERIOD_NS, cyclictest, measure, micros,
};

/// How something stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// As it should be.
    Good,
    /// A loop runs, less well than it could.
    Doubtful,
    /// A loop runs as best effort only.
    Lacking,
}

impl State {
    /// In one word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Doubtful => "doubtful",
            Self::Lacking => "lacking",
        }
    }
}

/// What something costs that is not as it should be, and what mends it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shortfall {
    /// What it costs a loop.
    pub cost: String,
    /// Command or change that mends it.
    pub remedy: String,
}

/// One thing looked at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Check {
    /// What it is.
    pub name: &'static str,
    /// How it stands.
    pub state: State,
    /// What was found.
    pub found: String,
    /// What is wrong, unless it is good.
    pub shortfall: Option<Shortfall>,
}

impl Check {
    /// As it should be.
    #[must_use]
    pub fn good(name: &'static str, found: impl Into<String>) -> Self {
        Self { name, state: State::Good, found: found.into(), shortfall: None }
    }

    /// Not as it should be.
    #[must_use]
    pub fn short(
        state: State,
        name: &'static str,
        found: impl Into<String>,
        cost: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        let shortfall = Some(Shortfall { cost: cost.into(), remedy: remedy.into() });
        Self { name, state, found: found.into(), shortfall }
    }
}

/// Everything a loop depends on, with what the measured one saw and was granted.
#[must_use]
pub fn examine(measured: &Measured) -> Vec<Check> {
    let mut checks = vec![kernel(), machine()];
    checks.extend(rights(&measured.report));
    checks.push(throttling());
    checks.extend(cores());
    checks.extend([governor(), idle(), timer(), clock_source()]);
    checks.push(wakeups::check(measured));
    checks.push(shared_memory());
    checks
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariant_a_folder_that_is_not_there_counts_as_its_parent() {
        let at = tempfile::tempdir().expect("a folder");
        assert_eq!(writable(&at.path().join("later")), Ok(()));
        assert!(writable(Path::new("/proc/none")).is_err());
        assert_eq!(fs::read_dir(at.path()).expect("a folder").count(), 0, "left nothing behind");
    }
}
