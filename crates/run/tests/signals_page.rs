//! `docs/signals.md` says what the table of signals says.

use docktwin_run::columns::{DOCKING, WITH_RIG, markdown};

#[path = "../../../tests/page.rs"]
mod page;

#[test]
fn invariant_the_page_of_signals_is_up_to_date() {
    page::check("signals.md", &[("docking", markdown(DOCKING)), ("rig", markdown(WITH_RIG))]);
}
