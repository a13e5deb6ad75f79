//! Surveys of the contact kernel at full size: `cargo run --release -p docktwin-physics --example
//! contact_survey -- WHAT COUNT [FIRST]`, WHAT one of `continuity`, `gradient`, `depths`,
//! `energies`, `memory`, `deep`, `dockings`. The tests run the same on a small sample.
#![allow(clippy::print_stdout, reason = "its purpose")]

#[path = "../tests/common/brute.rs"]
mod brute;
#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/draws.rs"]
mod draws;
#[path = "../tests/common/survey.rs"]
mod survey;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let number = |i: usize, or: u64| arguments.get(i).and_then(|a| a.parse().ok()).unwrap_or(or);
    let (count, first) = (number(2, 100), number(3, 0));
    let m = common::apas();
    for region in [draws::USUAL, draws::WILD] {
        let what = arguments.get(1).map_or("", String::as_str);
        match what {
            "continuity" => println!("{:?}", survey::continuity(&m, &region, count, first)),
            "gradient" => println!("{:?}", survey::gradient(&m, &region, count, first)),
            "depths" => println!("{:?}", survey::depths(&m, &region, count, first)),
            "energies" => println!("{:?}", survey::energies(&m, &region, count, first)),
            "memory" => println!("{:?}", survey::memory(&m, &region, count, first)),
            "deep" => println!("{:?}", survey::deep(&m, &region, count, first)),
            "dockings" => println!("{:?}", survey::dockings(&m, &region, count, first)),
            _ => {
                println!(
                    "continuity, gradient, depths, energies, memory, deep or dockings; then a count"
                );
                return;
            }
        }
    }
}
