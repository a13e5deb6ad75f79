//! `docs/scenarios.md` says what the table of keys says.

use std::fmt::Write as _;

use docktwin_scenario::explained;

#[path = "../../../tests/page.rs"]
mod page;

fn markdown() -> String {
    let mut out = String::from("| key | value | example | meaning |\n| --- | --- | --- | --- |\n");
    for k in explained(None).expect("all keys") {
        let cell = |text: &str| text.replace('|', "\\|").replace('\n', " ");
        let example = match k.example {
            "" => String::new(),
            line => format!("`{}`", cell(line)),
        };
        writeln!(out, "| `{}` | {} | {example} | {} |", k.key, cell(&k.allowed), cell(k.meaning))
            .expect("a text");
    }
    out
}

#[test]
fn invariant_the_page_of_scenarios_is_up_to_date() {
    page::check("scenarios.md", &[("keys", markdown())]);
}
