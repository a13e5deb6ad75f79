//! What the operating system must grant a loop that keeps time, and the raw calls behind it. Linux.
//!
//! The only place of the workspace with code that the compiler cannot check; it is all calls of the C
//! library whose arguments are built in the line above.

#![expect(unsafe_code, reason = "calls of the C library have no checked form")]

use core::{
    fmt,
    mem::MaybeUninit,
    sync::atomic::{AtomicI32, Ordering},
};
use std::io;

/// Finest difference between two readings of the clock, ns. 1 with high-resolution timers, a tick of
/// the kernel (1 to 10 ms) without.
#[must_use]
pub fn timer_resolution_ns() -> u64 {
    let mut t = MaybeUninit::<libc::timespec>::uninit();
    // SAFETY: `t` is writable and as large as the call expects; the clock exists on every Linux, and
    // a call that succeeds has filled `t`.
    let t = unsafe {
        let done = libc::clock_getres(libc::CLOCK_MONOTONIC, t.as_mut_ptr());
        debug_assert_eq!(done, 0);
        t.assume_init()
    };
    nanos(&t)
}

/// Sleeps until an instant of [`docktwin_rigport::clock::monotonic_ns`]; returns at once when it has passed.
pub fn sleep_until_ns(instant_ns: u64) {
    let until = timespec(instant_ns);
    // SAFETY: `until` is a valid instant and lives through the call; with an absolute instant no rest
    // is written, so that pointer may be null.
    let sleep = || unsafe {
        libc::clock_nanosleep(
            libc::CLOCK_MONOTONIC,
            libc::TIMER_ABSTIME,
            &raw const until,
            core::ptr::null_mut(),
        )
    };
    // A signal ends the sleep early; the instant is absolute, so sleeping on adds no drift.
    while sleep() == libc::EINTR {}
}

fn nanos(t: &libc::timespec) -> u64 {
    t.tv_sec.unsigned_abs() * 1_000_000_000 + t.tv_nsec.unsigned_abs()
}

fn timespec(ns: u64) -> libc::timespec {
    // SAFETY: every field is an integer, of which all zeros is a value; some targets pad the struct.
    let mut t: libc::timespec = unsafe { core::mem::zeroed() };
    // Both are in range: u64::MAX ns are 585 years.
    t.tv_sec = libc::time_t::try_from(ns / 1_000_000_000).unwrap_or(libc::time_t::MAX);
    t.tv_nsec = libc::c_long::try_from(ns % 1_000_000_000).unwrap_or(0);
    t
}

/// What to do when the machine does not grant everything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shortage {
    /// Refuse to run: required for a physical rig.
    Refuse,
    /// Run on what there is, and say that it is best effort (`--allow-best-effort`).
    BestEffort,
}

/// One thing asked of the operating system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// `SCHED_FIFO` for the calling thread.
    Priority,
    /// All memory of the process stays in RAM, the stack touched beforehand.
    Memory,
    /// The calling thread stays on one core.
    Affinity,
    /// Timers of the calling thread end when asked, not up to 50 µs later.
    TimerSlack,
}

impl Step {
    /// What a loop loses without it.
    #[must_use]
    pub const fn cost(self) -> &'static str {
        match self {
            Self::Priority => {
                "any busy process may hold the loop up, by milliseconds and now and then by far more"
            }
            Self::Memory => "a page that is not there costs up to milliseconds, in any tick",
            Self::Affinity => "the loop moves between cores, some 10 µs of cold caches each time",
            Self::TimerSlack => "wake-ups are up to 50 µs later",
        }
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Priority => "real-time priority",
            Self::Memory => "locked memory",
            Self::Affinity => "a core of its own",
            Self::TimerSlack => "exact timers",
        })
    }
}

/// What was not granted, its consequence, and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shortfall {
    /// What was asked for.
    pub step: Step,
    /// What the system said.
    pub what: String,
    /// Command or setting that mends it.
    pub remedy: String,
}

impl fmt::Display for Shortfall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; {}; mend it: {}", self.step, self.what, self.step.cost(), self.remedy)
    }
}

/// The machine does not grant what was asked, and best effort is not allowed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "this machine does not grant a real-time loop:\n  {}\nor run on what there is with \
     --allow-best-effort",
    shortfalls.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n  ")
)]
pub struct RealtimeError {
    /// At least one.
    pub shortfalls: Vec<Shortfall>,
}

/// What was granted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RealtimeReport {
    /// Steps that succeeded.
    pub granted: Vec<Step>,
    /// Steps that did not; empty unless best effort is allowed.
    pub shortfalls: Vec<Shortfall>,
}

impl RealtimeReport {
    /// True when something is lacking, and a result is therefore *degraded*.
    #[must_use]
    pub fn is_best_effort(&self) -> bool {
        !self.shortfalls.is_empty()
    }
}

/// What a loop asks of the operating system, for the thread that calls [`RealtimeSetup::apply`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RealtimeSetup {
    /// Priority of `SCHED_FIFO`, 1 to 99, default 80: above threads of interrupts (50), below those
    /// that keep the kernel alive (99).
    pub priority: u8,
    /// Core to stay on, default none; best one that `isolcpus=` keeps free.
    pub core: Option<usize>,
    /// Whether memory is locked, default true.
    pub lock_memory: bool,
}

impl Default for RealtimeSetup {
    fn default() -> Self {
        Self { priority: 80, core: None, lock_memory: true }
    }
}

/// Stack that is touched beforehand, bytes; a thread of Rust has 2 MiB unless it asks for another.
const STACK_BYTES: usize = 512 * 1024;

impl RealtimeSetup {
    /// Asks for everything. Threads started by the calling thread afterwards keep the core, not the
    /// priority: start the writer and the viewer's thread before.
    ///
    /// Allocates; call it before the loop.
    ///
    /// # Errors
    /// With [`Shortage::Refuse`], when anything was not granted; what was granted is given back.
    pub fn apply(&self, shortage: Shortage) -> Result<RealtimeReport, RealtimeError> {
        let mut report = RealtimeReport::default();
        let mut note = |step, result: Result<(), Shortfall>| match result {
            Ok(()) => report.granted.push(step),
            Err(s) => report.shortfalls.push(s),
        };
        note(Step::TimerSlack, exact_timers());
        if let Some(core) = self.core {
            note(Step::Affinity, stay_on(core));
        }
        if self.lock_memory {
            note(Step::Memory, lock_memory());
        }
        // Last: what comes before need not be done at this priority.
        note(Step::Priority, set_fifo(self.priority));
        if shortage == Shortage::Refuse && report.is_best_effort() {
            relax();
            return Err(RealtimeError { shortfalls: report.shortfalls });
        }
        Ok(report)
    }
}

/// Gives priority and locked memory back, when the loop has ended and files are to be written.
pub fn relax() {
    let none = libc::sched_param { sched_priority: 0 };
    // To take the flag back would need a right that this process may not have.
    let policy = libc::SCHED_OTHER | libc::SCHED_RESET_ON_FORK;
    // SAFETY: `none` lives through the call, 0 is the calling thread; neither call touches memory of
    // ours. Giving back needs no right and cannot fail.
    unsafe {
        libc::sched_setscheduler(0, policy, &raw const none);
        libc::munlockall();
    }
}

/// Number of the signal that asked to end, once [`catch_termination`] was called; 0 before.
static TERMINATION: AtomicI32 = AtomicI32::new(0);

const TERMINATING: [(libc::c_int, &str); 3] =
    [(libc::SIGINT, "SIGINT"), (libc::SIGTERM, "SIGTERM"), (libc::SIGHUP, "SIGHUP")];

extern "C" fn on_termination(signal: libc::c_int) {
    TERMINATION.store(signal, Ordering::Relaxed);
    // SAFETY: `signal` is allowed in a signal handler; the next one of its kind ends the process.
    unsafe {
        libc::signal(signal, libc::SIG_DFL);
    }
}

/// Whether a signal has asked this process to end.
#[derive(Clone, Copy, Debug)]
pub struct Termination(());

impl Termination {
    /// Name of the signal, once one has come.
    #[must_use]
    pub fn signal(self) -> Option<&'static str> {
        let number = TERMINATION.load(Ordering::Relaxed);
        TERMINATING.iter().find(|(n, _)| *n == number).map(|(_, name)| *name)
    }
}

/// From now on the first SIGINT, SIGTERM or SIGHUP does not end the process but is told by what is
/// returned, so that a rig comes to rest and a recording is closed first. A second one of the same kind
/// ends it. A signal that was ignored stays ignored (`nohup`).
pub fn catch_termination() -> Termination {
    let handler = on_termination as extern "C" fn(libc::c_int) as libc::sighandler_t;
    for (signal, _) in TERMINATING {
        // SAFETY: the handler stores to an atomic and calls `signal`, both allowed in a signal handler,
        // and lives as long as the process.
        unsafe {
            if libc::signal(signal, handler) == libc::SIG_IGN {
                libc::signal(signal, libc::SIG_IGN);
            }
        }
    }
    Termination(())
}

fn set_fifo(priority: u8) -> Result<(), Shortfall> {
    let wanted = libc::sched_param { sched_priority: i32::from(priority) };
    // Threads started later begin without the priority: a writer must not compete with the loop.
    let policy = libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK;
    // SAFETY: `wanted` lives through the call, 0 is the calling thread.
    let done = unsafe { libc::sched_setscheduler(0, policy, &raw const wanted) };
    if done == 0 {
        return Ok(());
    }
    let error = io::Error::last_os_error();
    let rights = Rights::read();
    let remedy = if !(1..=99).contains(&priority) {
        "choose a priority from 1 to 99".to_owned()
    } else if rights.cap_sys_nice {
        // The right is there and still no: the control group has no share of real time.
        "give the control group real time: sudo sysctl -w kernel.sched_rt_runtime_us=-1, in a \
         container: docker run --cap-add sys_nice --ulimit rtprio=99"
            .to_owned()
    } else {
        grant(Grant::Priority, bounding_set())
    };
    let what = format!("SCHED_FIFO {priority} was refused ({error})");
    Err(Shortfall { step: Step::Priority, what, remedy })
}

/// What a right is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Grant {
    Priority,
    Memory,
}

/// How a right is granted where no process may get capabilities beyond `bounding_set`. A program whose file
/// has others does not start at all, so a file in a container must not be given them.
fn grant(right: Grant, bounding_set: u64) -> String {
    let both = (1 << CAP_SYS_NICE) | (1 << CAP_IPC_LOCK);
    if bounding_set & both != both {
        return "start the container with more rights: docker run --cap-add sys_nice --cap-add ipc_lock \
                --ulimit rtprio=99 --ulimit memlock=-1 (setcap does not help: the capabilities are outside \
                the bounding set, and a program that has them in its file does not start here)"
            .to_owned();
    }
    let (limit, file) = match right {
        Grant::Priority => ("rtprio 95", "95-docktwin.conf"),
        Grant::Memory => ("memlock unlimited", "96-docktwin.conf"),
    };
    format!(
        "sudo setcap cap_sys_nice,cap_ipc_lock=ep $(command -v docktwin), or for a user: echo \"$USER - \
         {limit}\" | sudo tee /etc/security/limits.d/{file}, then log in again"
    )
}

/// Capabilities that any process here may ever get.
fn bounding_set() -> u64 {
    // SAFETY: the call takes numbers alone. 1: in the set.
    let within = |cap: u32| unsafe { libc::prctl(libc::PR_CAPBSET_READ, cap, 0, 0, 0) } == 1;
    (0..64).filter(|cap| within(*cap)).fold(0, |set, cap| set | 1 << cap)
}

fn lock_memory() -> Result<(), Shortfall> {
    let shortfall = |what| {
        Err(Shortfall { step: Step::Memory, what, remedy: grant(Grant::Memory, bounding_set()) })
    };
    // Within a limit locking may succeed now, and a later request for memory would then fail.
    if let Some(limit) = Rights::read().lockable_bytes {
        return shortfall(format!("at most {} KiB may be locked", limit / 1024));
    }
    // SAFETY: the call takes flags alone; pages stay where they are.
    let done = unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) };
    if done != 0 {
        return shortfall(format!("locking was refused ({})", io::Error::last_os_error()));
    }
    touch_stack();
    Ok(())
}

/// Makes the kernel map the stack that the loop will use.
#[inline(never)]
fn touch_stack() {
    let mut stack = [0_u8; STACK_BYTES];
    for page in stack.chunks_mut(4096) {
        page[0] = core::hint::black_box(1);
    }
    core::hint::black_box(&stack);
}

fn stay_on(core: usize) -> Result<(), Shortfall> {
    let shortfall = |what: String, remedy| Err(Shortfall { step: Step::Affinity, what, remedy });
    let allowed = Rights::read().cores;
    let choose = || {
        let all: Vec<String> = allowed.iter().map(ToString::to_string).collect();
        format!("choose one of {}", all.join(", "))
    };
    if !allowed.contains(&core) {
        return shortfall(format!("core {core} is not there for this process"), choose());
    }
    set_cores(0, &[core]).or_else(|e| shortfall(format!("core {core} was refused ({e})"), choose()))
}

/// Lets a thread run on these cores alone; 0 is the calling one.
fn set_cores(thread: libc::pid_t, cores: &[usize]) -> io::Result<()> {
    // SAFETY: a set of cores is an array of bits, of which all zeros is a value; every core is below
    // its number of bits, because it came from such a set; the set lives through the call.
    let done = unsafe {
        let mut set: libc::cpu_set_t = core::mem::zeroed();
        cores.iter().for_each(|core| libc::CPU_SET(*core, &mut set));
        libc::sched_setaffinity(thread, size_of::<libc::cpu_set_t>(), &raw const set)
    };
    if done == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Keeps all other threads of this process off the core that the calling one was given, as far as there
/// are others: writers and the live viewer's sender leave its caches alone.
pub fn keep_others_off(core: usize) {
    // SAFETY: takes nothing, cannot fail.
    let this = unsafe { libc::gettid() };
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let threads = threads.filter_map(|t| t.file_name().to_str()?.parse::<libc::pid_t>().ok());
    for thread in threads.filter(|t| *t != this) {
        let left: Vec<usize> = cores(thread).into_iter().filter(|c| *c != core).collect();
        if !left.is_empty() {
            // A thread that has ended meanwhile is no concern.
            let _ = set_cores(thread, &left);
        }
    }
}

fn exact_timers() -> Result<(), Shortfall> {
    // SAFETY: the call takes numbers alone; 1 ns is the least, 0 would mean the default of 50 µs.
    let done = unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64, 0_u64, 0_u64, 0_u64) };
    if done == 0 {
        return Ok(());
    }
    let what = format!("the timer slack cannot be set ({})", io::Error::last_os_error());
    let remedy = "allow prctl(PR_SET_TIMERSLACK) in the sandbox of this process".to_owned();
    Err(Shortfall { step: Step::TimerSlack, what, remedy })
}

/// What this process may ask for, without asking for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rights {
    /// The capability `CAP_SYS_NICE`: any priority.
    pub cap_sys_nice: bool,
    /// Highest priority of `SCHED_FIFO` without it; 0 for none.
    pub priority_limit: u64,
    /// Memory that may be locked, bytes; `None` without a limit.
    pub lockable_bytes: Option<u64>,
    /// Cores on which this process may run.
    pub cores: Vec<usize>,
}

/// Bits of Linux' capabilities.
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;

impl Rights {
    /// Asks the kernel.
    #[must_use]
    pub fn read() -> Self {
        let held = capabilities();
        let limit = if held & (1 << CAP_IPC_LOCK) == 0 {
            Some(soft_limit(libc::RLIMIT_MEMLOCK)).filter(|l| *l != libc::RLIM_INFINITY)
        } else {
            None
        };
        Self {
            cap_sys_nice: held & (1 << CAP_SYS_NICE) != 0,
            priority_limit: soft_limit(libc::RLIMIT_RTPRIO),
            lockable_bytes: limit,
            cores: cores(0),
        }
    }

    /// Whether `SCHED_FIFO` of this priority will be granted, control groups apart.
    #[must_use]
    pub fn allows(&self, priority: u8) -> bool {
        self.cap_sys_nice || self.priority_limit >= u64::from(priority)
    }
}

/// Capabilities in force, the first 32.
fn capabilities() -> u32 {
    /// Third version: two sets of 32 capabilities.
    const VERSION: u32 = 0x2008_0522;
    #[repr(C)]
    struct Header {
        version: u32,
        pid: i32,
    }
    #[repr(C)]
    #[derive(Clone, Copy, Default)]
    struct Sets {
        effective: u32,
        permitted: u32,
        inheritable: u32,
    }
    let mut header = Header { version: VERSION, pid: 0 };
    let mut sets = [Sets::default(); 2];
    // SAFETY: `header` and `sets` have the layout of this version and live through the call; the
    // kernel writes at most two sets, and the version it would have liked better.
    let done = unsafe { libc::syscall(libc::SYS_capget, &raw mut header, sets.as_mut_ptr()) };
    if done == 0 { sets[0].effective } else { 0 }
}

fn soft_limit(of: libc::__rlimit_resource_t) -> u64 {
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: `limit` lives through the call, which fills it or leaves the zeros.
    unsafe { libc::getrlimit(of, &raw mut limit) };
    limit.rlim_cur
}

/// Cores that a thread may run on; 0 is the calling one.
fn cores(thread: libc::pid_t) -> Vec<usize> {
    // SAFETY: all zeros is a set of cores; the call gets its true size and fills it or leaves the
    // zeros; every number asked for is below the number of its bits.
    unsafe {
        let mut set: libc::cpu_set_t = core::mem::zeroed();
        libc::sched_getaffinity(thread, size_of::<libc::cpu_set_t>(), &raw mut set);
        (0..8 * size_of::<libc::cpu_set_t>()).filter(|c| libc::CPU_ISSET(*c, &set)).collect()
    }
}

#[cfg(test)]
mod tests {
    use docktwin_rigport::clock::monotonic_ns;

    use super::*;

    /// In a thread of its own, because the setting is the thread's.
    fn apart<T: Send + 'static>(f: impl FnOnce() -> T + Send + 'static) -> T {
        std::thread::spawn(f).join().expect("no panic")
    }

    #[test]
    fn invariant_the_clock_does_not_run_back_and_a_sleep_is_never_short() {
        let mut last = monotonic_ns();
        for _ in 0..20 {
            let until = last + 50_000;
            sleep_until_ns(until);
            let now = monotonic_ns();
            assert!(now >= until, "woken {} ns early", until - now);
            last = now;
        }
        // An instant that has passed is no reason to sleep.
        sleep_until_ns(0);
        assert!(timer_resolution_ns() >= 1);
    }

    #[test]
    fn invariant_what_is_asked_in_vain_is_refused_or_degrades() {
        // Neither the priority nor the core exists anywhere.
        let setup = RealtimeSetup { priority: 200, core: Some(100_000), lock_memory: false };
        let (refused, degraded) =
            apart(move || (setup.apply(Shortage::Refuse), setup.apply(Shortage::BestEffort)));
        let refused = refused.expect_err("nobody has priority 200");
        let text = refused.to_string();
        for word in ["SCHED_FIFO 200", "core 100000", "--allow-best-effort", "mend it"] {
            assert!(text.contains(word), "{word}: {text}");
        }
        let report = degraded.expect("best effort goes on");
        assert!(report.is_best_effort());
        assert_eq!(report.shortfalls, refused.shortfalls);
        assert_eq!(report.granted, [Step::TimerSlack]);
    }

    /// With one core there is nowhere to go.
    #[test]
    fn invariant_others_leave_the_core_and_come_to_no_harm() {
        let allowed = cores(0);
        let core = allowed[allowed.len() - 1];
        let (tell, told) = std::sync::mpsc::channel();
        let (go, wait) = std::sync::mpsc::channel::<()>();
        let other = std::thread::spawn(move || {
            // SAFETY: takes nothing, cannot fail.
            tell.send(unsafe { libc::gettid() }).expect("somebody listens");
            let _ = wait.recv();
        });
        let thread = told.recv().expect("a thread");
        apart(move || keep_others_off(core));
        let left: Vec<usize> = allowed.iter().copied().filter(|c| *c != core).collect();
        assert_eq!(cores(thread), if left.is_empty() { &allowed } else { &left }[..]);
        // Other tests run in this process.
        for entry in std::fs::read_dir("/proc/self/task").expect("Linux").flatten() {
            let thread = entry.file_name().to_str().and_then(|t| t.parse().ok()).expect("a number");
            let _ = set_cores(thread, &allowed);
        }
        drop(go);
        other.join().expect("no panic");
    }

    #[test]
    fn invariant_rights_say_what_will_be_granted() {
        let rights = Rights::read();
        assert!(!rights.cores.is_empty());
        let core = rights.cores[0];
        let setup = RealtimeSetup { priority: 1, core: Some(core), lock_memory: false };
        let report = apart(move || {
            let report = setup.apply(Shortage::BestEffort);
            // Only this thread was moved, and only to the core asked for.
            assert_eq!(Rights::read().cores, [core]);
            relax();
            report
        })
        .expect("best effort goes on");
        if !rights.allows(1) {
            assert_eq!(report.shortfalls[0].step, Step::Priority);
        }
        assert!(report.granted.contains(&Step::Affinity));
    }

    /// Case C17: in a container without the capabilities a program whose file has them does not start.
    #[test]
    fn regress_setcap_is_advised_only_where_it_works() {
        for right in [Grant::Priority, Grant::Memory] {
            assert!(grant(right, u64::MAX).starts_with("sudo setcap cap_sys_nice,cap_ipc_lock=ep"));
            // Docker's own set has neither; one of both is not enough.
            for bounding in [0xa804_25fb, 0, 1 << CAP_SYS_NICE, 1 << CAP_IPC_LOCK] {
                let advice = grant(right, bounding);
                assert!(!advice.contains("sudo"), "{advice}");
                assert!(advice.contains("--cap-add sys_nice --cap-add ipc_lock"), "{advice}");
            }
        }
        let kernel = std::fs::read_to_string("/proc/self/status").expect("Linux");
        let line = kernel.lines().find_map(|l| l.strip_prefix("CapBnd:")).expect("the set");
        assert_eq!(bounding_set(), u64::from_str_radix(line.trim(), 16).expect("a number"));
    }
}
