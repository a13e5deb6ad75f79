//! The command line as users meet it: help, messages, exit codes.
//!
//! Snapshots are `tests/cmd/*.trycmd`. When words changed on purpose, write them again with
//! `TRYCMD=overwrite cargo test -p docktwin --test cli` and read the difference before committing.

#[test]
fn regress_help_and_messages() {
    let cases = trycmd::TestCases::new();
    cases.case("tests/cmd/*.trycmd");
    // miette and clap ask for these before they choose a width and colours.
    for (name, value) in [("COLUMNS", "100"), ("NO_COLOR", "1")] {
        cases.env(name, value);
    }
}
