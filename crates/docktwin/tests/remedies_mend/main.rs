//! Remedies that mend: what the product says to do about a fault is done, and the fault is gone.
//!
//! Every remedy in the sources has a case here, or a line in [`ELSEWHERE`] that says where it is tried, or why no
//! test can.

mod commands;
mod elsewhere;
mod files;
mod texts;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use elsewhere::{ELSEWHERE, Where};

/// A new remedy needs a case, and a case a remedy that is still there.
#[test]
fn invariant_every_remedy_has_a_case() {
    let sources = texts::in_sources();
    let mut tried: BTreeSet<&str> =
        ELSEWHERE.iter().flat_map(|(remedies, _)| remedies.iter().copied()).collect();
    let cases = files::cases();
    tried.extend(cases.iter().map(|c| c.remedy));
    tried.extend(commands::CASES.iter().map(|c| c.remedy));
    let new: Vec<_> = sources.iter().filter(|(r, _)| !tried.contains(r.as_str())).collect();
    assert!(new.is_empty(), "{} remedies without a case: {new:#?}", new.len());
    let old: Vec<_> = tried.iter().filter(|r| !sources.contains_key(**r)).collect();
    assert!(old.is_empty(), "cases of remedies that are gone: {old:#?}");
}

/// Tests that are named exist.
#[test]
fn invariant_what_is_tried_elsewhere_is() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for (remedies, place) in ELSEWHERE {
        match place {
            Where::Test(file, name) => {
                let text = fs::read_to_string(root.join(file)).expect("the file of the test");
                assert!(
                    text.contains(&format!("fn {name}(")),
                    "{file} has no {name}: {remedies:?}"
                );
            }
            Where::Nowhere(why) => assert!(why.len() > 10, "{remedies:?}"),
        }
    }
}
