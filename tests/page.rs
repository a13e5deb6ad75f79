//! Pages of `docs/` that hold tables made from the code, each between two comments. Shared by the tests
//! of the crates whose tables they are; `cargo xtask docs-tables` runs those with `UPDATE_DOCS` set.

use std::{fs, path::Path};

/// Holds the block `name` of a page against what the code says, or with `UPDATE_DOCS` writes it.
pub(crate) fn check(page: &str, blocks: &[(&str, String)]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(page);
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut new = text.clone();
    for (name, block) in blocks {
        new = with_block(&new, name, block).unwrap_or_else(|| {
            panic!("{page}: no `{}` … `{}`", begin(name), end(name));
        });
    }
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(&path, &new).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    } else {
        assert!(
            new == text,
            "docs/{page} is not what the code says: run `cargo xtask docs-tables`"
        );
    }
}

fn begin(name: &str) -> String {
    format!("<!-- begin {name}: made by `cargo xtask docs-tables` -->")
}

fn end(name: &str) -> String {
    format!("<!-- end {name} -->")
}

fn with_block(text: &str, name: &str, block: &str) -> Option<String> {
    let (before, rest) = text.split_once(&begin(name))?;
    let (_, after) = rest.split_once(&end(name))?;
    Some(format!("{before}{}\n\n{}\n\n{}{after}", begin(name), block.trim(), end(name)))
}
