//! Remedies that are not obeyed here.

/// Where a remedy is tried.
pub(crate) enum Where {
    /// A test: its file and its name.
    Test(&'static str, &'static str),
    /// No test can, and why.
    Nowhere(&'static str),
}
use Where::{Nowhere, Test};

/// Remedies, and where they are tried.
pub(crate) const ELSEWHERE: &[(&[&str], Where)] = &[
    (
        &[
            "move them apart, at least 0.02 m",
            "turn the plate's joint triangle by 60 deg against the base's, the two legs of a corner to different corners",
            "exchange their plate joints, or move the joints apart",
        ],
        Test("crates/model/src/tests.rs", "regress_impossible_rigs_are_refused_by_geometry"),
    ),
    (
        &[
            "name a new file with {option}, or move that one away",
            "name a file in a folder of yours with {option}",
            "name different files with --out and --drive",
        ],
        Test(
            "crates/docktwin/tests/same_kinds.rs",
            "oracle_directories_and_files_that_are_there_stay",
        ),
    ),
    (
        &["add its content, or allow files of the disk"],
        Test("crates/model/src/sources.rs", "invariant_memory_hides_the_disk_and_may_stand_alone"),
    ),
    (
        &[
            "a leg stands on its limit switch: drive it off by hand",
            "pressed: release it",
            "joined, or held by a latch, since the run before: draw back with `docktwin rig retract`",
            "fix what failed and arm again; nothing has moved",
        ],
        Test(
            "crates/hil/tests/supervised.rs",
            "invariant_every_shortfall_is_refused_with_a_line_of_its_own",
        ),
    ),
    (
        &["free some space or choose another disk with --out"],
        Test(
            "crates/docktwin/tests/nothing_is_lost.rs",
            "invariant_a_full_disk_is_one_error_and_what_was_written_stays",
        ),
    ),
    (
        &["choose a directory you may write to with --out"],
        Test(
            "crates/docktwin/tests/nothing_is_lost.rs",
            "invariant_a_run_that_cannot_begin_is_bad_input",
        ),
    ),
    (
        &[
            "install it:\n{install}\nor name a Python that has it",
            "{}: --python PATH, or DOCKTWIN_PYTHON in the environment",
        ],
        Test(
            "crates/docktwin/tests/validate.rs",
            "regress_a_missing_python_says_how_to_install_it",
        ),
    ),
    (
        &["name it: --validation DIR", "name it", "give the one that holds {ENTRY}"],
        Test(
            "crates/study/src/crosscheck/second.rs",
            "regress_what_is_missing_is_named_with_what_to_do",
        ),
    ),
    (
        &[
            "give 0.01 to 0.5 m/s",
            "give a mechanism with [attenuation.characteristic], loaded with that attenuation",
        ],
        Test("crates/study/src/single_dof.rs", "regress_what_cannot_be_compared_says_what_to_do"),
    ),
    (
        &["give a mechanism with an attenuation that moves", "name at least one in `axes`"],
        Test("crates/study/src/mechanism.rs", "regress_what_cannot_be_tested_says_what_to_do"),
    ),
    (
        &[
            "{install}\nor name it: --viewer PATH. Without a display: --save FILE.rrd",
            "without a display, write the file with --save FILE.rrd and open it elsewhere",
        ],
        Test(
            "crates/docktwin/tests/view.rs",
            "invariant_without_a_viewer_the_error_names_the_command_that_installs_it",
        ),
    ),
    (
        &["switch them off once: {} analytics disable"],
        Test(
            "crates/docktwin/tests/view.rs",
            "invariant_the_viewer_is_opened_with_statistics_off_or_not_at_all",
        ),
    ),
    (
        &[
            "start it with `docktwin rig emulate RIG.toml --name {name}`",
            "a rig that still runs under this name is ended with Ctrl-C",
            "start the rig again; see the rights on /dev/shm",
        ],
        Test("crates/docktwin/tests/rig.rs", "invariant_a_rig_in_another_process_is_the_same_rig"),
    ),
    (
        &[
            "files are never overwritten: give a new one with --out",
            "give a file that `docktwin rig identify` or `rig calibrate` wrote for this rig",
            "make it again with `docktwin rig identify`",
        ],
        Test("crates/docktwin/tests/rig.rs", "invariant_files_come_back_as_they_were_written"),
    ),
    (
        &[
            "this recording was not made by `docktwin rehearse`",
            "the recording is damaged; use another copy",
            "this version knows `full` and `reduced`",
        ],
        Test("crates/docktwin/tests/hostile_inputs.rs", "regress_damaged_recordings"),
    ),
    (
        &["run.mcap and the models are not of one run, or damaged; use another copy"],
        Test("tests/tests/records_tell_the_truth.rs", "regress_files_of_another_run_are_told"),
    ),
    (
        &[
            "run it in a terminal, or add --yes when the emergency stop has been tested and nobody is near the rig",
            "test the emergency stop, see that nobody is near the rig, and type `arm`",
            "mend that and begin again; nothing was written",
            "the rig was stopped; fix the cause, or draw it back with its own controller",
            "give a scenario with a stick, scenarios/vibro_impact.toml is one",
            "let it swing by more than its play of {mm} mm",
            "name one that runs: --rig ipc:NAME",
            "name the scenario whose mechanism stands on the rig: --scenario FILE",
            "put the rig's file beside the models of docktwin",
            "see docs/bring-up-a-rig.md for what a rig needs before a test",
        ],
        Nowhere("they ask a person at a rig, or a rig that runs for minutes"),
    ),
    (
        &[
            "choose a priority from 1 to 99",
            "give the control group real time: sudo sysctl -w kernel.sched_rt_runtime_us=-1, in a container: docker \
             run --cap-add sys_nice --ulimit rtprio=99",
            "allow prctl(PR_SET_TIMERSLACK) in the sandbox of this process",
            "`docktwin doctor` tells what mends it; --allow-best-effort does without",
            "Debian: sudo apt install linux-image-rt-amd64, Ubuntu: sudo pro enable realtime-kernel; then start the \
             machine anew",
            "for a rig of steel: run on the machine itself; otherwise pin its virtual cores on the host: virsh \
             vcpupin …",
            "sudo sysctl -w kernel.sched_rt_runtime_us=950000",
            "give the process, container or virtual machine two cores or more: taskset -c 0,1 …",
            "add `isolcpus=managed_irq,domain,{last} nohz_full={last} rcu_nocbs={last}` to GRUB_CMDLINE_LINUX of \
             /etc/default/grub, then: sudo update-grub && sudo reboot; give the loop that core",
            "sudo cpupower frequency-set -g performance",
            "sudo cpupower idle-set -D {IDLE_LIMIT_US}",
            "start the kernel without highres=off, or take one built with CONFIG_HIGH_RES_TIMERS=y",
            "echo tsc | sudo tee {folder}/current_clocksource",
            "look why the kernel left tsc: sudo dmesg | grep -i tsc",
            "end other programs, mend what stands above, measure again: docktwin doctor",
            "close other programs, then measure again",
            "give yourself the right to read it",
            "free some space, or set TMPDIR to a folder that can be written",
            "free some space, or set TMPDIR to another folder",
        ],
        Nowhere("they change the machine, or need a user who is not root"),
    ),
    (
        &["take a mechanism with fewer latches for a rig"],
        Nowhere("no shipped mechanism has more than three"),
    ),
    (
        &["above 0, at most 0.05 m", "at least one"],
        Nowhere("bounds of options of a library, which the parser of the command line keeps"),
    ),
    (
        &[
            "{rows} rows are more than a MATLAB level 5 file can hold; export with --every, or as csv",
            "`{name}` is longer than the {NAME_MAX} characters of a MATLAB name; leave it out with --columns, or export \
             as csv",
        ],
        Nowhere("no recording of ours has such a name, and one of so many rows has 2 GB"),
    ),
    (
        &[
            "rehearse again with this version",
            "run the second engine again with this version",
            "show it with the version that made it, or rehearse again",
            "the recording was made by another version; replay it with that one",
            "replay runs with --rig emulated and the virtual clock; `diff` compares others",
        ],
        Nowhere("they name another version of docktwin, or a run that kept the wall's time"),
    ),
    (
        &[
            "`docktwin model check FILE` says where; make the workspace smaller or the platform larger",
            "make the docking workspace smaller or the platform larger",
            "mend the rig file, or the settings given with --set",
            "correct the rig file, or the changes to the leg control",
            "correct these options",
            "correct the rig file",
            "correct oil volume and valve in the rig file",
            "mend the rig's file; models/urdf/stewart.toml is an example",
            "mend {}",
            "correct the scenario or the option that gives it",
            "this is a defect of docktwin: report it",
            "name one that it has",
            "give another directory with --out",
            "make the meshes with `cargo xtask meshes`, or mend the name in the URDF",
            "run it again when nothing else writes the file",
            "check the sizes and stiffnesses in the file; the CSV files are written",
            "the runs are written; `docktwin diff` compares them",
            "docktwin's own run is written; what the second engine can run is in validation/README.md",
        ],
        Nowhere(
            "what they are about is refused before, by a remedy that is tried, when a file is read",
        ),
    ),
    (
        &[
            "the loop is unstable there: `docktwin analyze stiffness` tells its poles; lower the gains with --set, or \
             give a smaller --amplitude-mm",
            "the loop is unstable there: lower the gains of the leg control, or the amplitude",
            "check the travels and the series brakes of the attenuation; a brake that is stiff and hardly viscous \
             needs very small steps",
            "give the free channels some stiffness or damping, so that they have a place of their own",
            "leave it out: the lead then follows the rig",
            "docktwin view --compare RUN_A RUN_B",
        ],
        Nowhere(
            "they take minutes of computing to be asked for and to be obeyed, or the parser asks before",
        ),
    ),
    (
        &[
            "add one, models/urdf/apas_active.toml is an example; or leave --mechanism-draw out",
            "give --mechanism-draw N with N from 1 on, or leave the grade out",
            "leave one of them out",
        ],
        Nowhere(
            "an option to leave out, or a table to copy from a shipped file: nothing is left to be looked at",
        ),
    ),
];
