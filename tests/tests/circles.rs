//! No circle of files inside a crate: what a file needs can be read before it, a parent and its own
//! children apart.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use syn::{
    ItemMod, ItemUse, UseTree,
    visit::{self, Visit},
};

type Module = Vec<String>;

/// Sources of a crate by module; of a package with library and program both, in one tree.
fn modules(src: &Path) -> BTreeMap<Module, PathBuf> {
    fn walk(folder: &Path, prefix: &Module, out: &mut BTreeMap<Module, Vec<PathBuf>>) {
        for entry in fs::read_dir(folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            let stem = path.file_stem().expect("a name").to_string_lossy().into_owned();
            let mut module = prefix.clone();
            if path.is_dir() {
                module.push(stem);
                walk(&path, &module, out);
            } else if path.extension().is_some_and(|e| e == "rs") && stem != "tests" {
                if !["lib", "main", "mod"].contains(&stem.as_str()) {
                    module.push(stem);
                }
                out.entry(module).or_default().push(path);
            }
        }
    }
    let mut found = BTreeMap::new();
    walk(src, &Vec::new(), &mut found);
    found
        .into_iter()
        .flat_map(|(m, paths)| paths.into_iter().map(move |p| (m.clone(), p)))
        .collect()
}

/// Paths that a file names, from the root of its crate.
struct Names<'a> {
    module: &'a Module,
    /// Modules written inside the file, outermost first.
    inside: Vec<String>,
    found: BTreeSet<Module>,
}

impl Names<'_> {
    fn add(&mut self, parts: &[String]) {
        let mut here: Module = self.module.iter().chain(&self.inside).cloned().collect();
        let mut rest = parts;
        match parts.first().map(String::as_str) {
            Some("crate") => {
                here.clear();
                rest = &parts[1..];
            }
            Some("self") => rest = &parts[1..],
            Some("super") => {
                while rest.first().is_some_and(|p| p == "super") {
                    here.pop();
                    rest = &rest[1..];
                }
            }
            // A child by its name, or another crate: the latter is no module and is found to be none.
            _ => {}
        }
        here.extend(rest.iter().cloned());
        self.found.insert(here);
    }

    fn tree(&mut self, prefix: &mut Module, tree: &UseTree) {
        match tree {
            UseTree::Path(p) => {
                prefix.push(p.ident.to_string());
                self.tree(prefix, &p.tree);
                prefix.pop();
            }
            UseTree::Name(n) => {
                prefix.push(n.ident.to_string());
                self.add(&prefix.clone());
                prefix.pop();
            }
            UseTree::Rename(r) => {
                prefix.push(r.ident.to_string());
                self.add(&prefix.clone());
                prefix.pop();
            }
            UseTree::Glob(_) => self.add(&prefix.clone()),
            UseTree::Group(g) => g.items.iter().for_each(|t| self.tree(prefix, t)),
        }
    }
}

impl<'ast> Visit<'ast> for Names<'_> {
    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        self.tree(&mut Vec::new(), &item.tree);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let parts: Module = path.segments.iter().map(|s| s.ident.to_string()).collect();
        if parts.len() > 1 {
            self.add(&parts);
        }
        visit::visit_path(self, path);
    }

    fn visit_item_mod(&mut self, item: &'ast ItemMod) {
        // Tests may look around as they like.
        if item.ident == "tests" {
            return;
        }
        self.inside.push(item.ident.to_string());
        visit::visit_item_mod(self, item);
        self.inside.pop();
    }
}

fn related(a: &Module, b: &Module) -> bool {
    a.starts_with(b) || b.starts_with(a)
}

/// What every module needs of other modules that are neither above nor below it.
fn needs(sources: &BTreeMap<Module, String>) -> BTreeMap<Module, BTreeSet<Module>> {
    let mut out = BTreeMap::new();
    for (module, text) in sources {
        let file = syn::parse_file(text).unwrap_or_else(|e| panic!("{module:?}: {e}"));
        let mut names = Names { module, inside: Vec::new(), found: BTreeSet::new() };
        names.visit_file(&file);
        let known = |name: &Module| {
            (1..=name.len()).rev().map(|n| name[..n].to_vec()).find(|m| sources.contains_key(m))
        };
        let needed: BTreeSet<Module> =
            names.found.iter().filter_map(known).filter(|m| !related(m, module)).collect();
        out.insert(module.clone(), needed);
    }
    out
}

/// What is left when everything that needs nothing more, and then what needed only that, is taken away:
/// the circles, and what leads from one to another.
fn circles(mut needs: BTreeMap<Module, BTreeSet<Module>>) -> BTreeMap<Module, BTreeSet<Module>> {
    for direction in 0..2 {
        loop {
            let free: Vec<Module> =
                needs.iter().filter(|(_, n)| n.is_empty()).map(|(m, _)| m.clone()).collect();
            if free.is_empty() {
                break;
            }
            for m in &free {
                needs.remove(m);
            }
            for n in needs.values_mut() {
                n.retain(|m| !free.contains(m));
            }
        }
        // Once more against the arrows, so that what only leads into a circle goes as well.
        if direction == 0 {
            let mut back: BTreeMap<Module, BTreeSet<Module>> =
                needs.keys().map(|m| (m.clone(), BTreeSet::new())).collect();
            for (m, n) in &needs {
                for to in n {
                    back.entry(to.clone()).or_default().insert(m.clone());
                }
            }
            needs = back;
        }
    }
    needs
}

fn shown(m: &Module) -> String {
    if m.is_empty() { "crate".to_owned() } else { m.join("::") }
}

#[test]
fn invariant_no_circle_of_files_inside_a_crate() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let mut wrong = Vec::new();
    let mut folders: Vec<PathBuf> = fs::read_dir(root.join("crates"))
        .expect("crates/")
        .map(|e| e.expect("an entry").path())
        .chain([root.join("xtask")])
        .filter(|p| p.join("src").is_dir())
        .collect();
    folders.sort();
    assert!(folders.len() > 10, "only {} crates were found", folders.len());
    for folder in folders {
        let sources: BTreeMap<Module, String> = modules(&folder.join("src"))
            .into_iter()
            .map(|(m, path)| (m, fs::read_to_string(path).expect("a source is text")))
            .collect();
        let left = circles(needs(&sources));
        if !left.is_empty() {
            let names: Vec<String> = left
                .iter()
                .map(|(m, n)| {
                    let by: Vec<String> = n.iter().map(shown).collect();
                    format!("{} is needed by {}", shown(m), by.join(", "))
                })
                .collect();
            let name = folder.file_name().expect("a name").to_string_lossy().into_owned();
            wrong.push(format!("{name}: {}", names.join("; ")));
        }
    }
    assert!(wrong.is_empty(), "files that need each other\n  {}", wrong.join("\n  "));
}

/// The negative control: circles are seen, and only circles.
#[test]
fn invariant_a_circle_is_seen() {
    let of = |files: &[(&str, &str)]| {
        let sources = files
            .iter()
            .map(|(m, text)| {
                let module = m.split("::").filter(|p| !p.is_empty()).map(str::to_owned).collect();
                (module, (*text).to_owned())
            })
            .collect();
        circles(needs(&sources)).keys().map(shown).collect::<Vec<_>>()
    };
    let root = ("", "mod a; mod b; mod c;");
    let a = ("a", "use crate::{b::B, Root}; pub struct A(B);");
    assert_eq!(of(&[root, a, ("b", "use super::a::A;"), ("c", "")]), ["a", "b"]);
    assert_eq!(
        of(&[root, a, ("b", "fn f(x: crate::c::C) {}"), ("c", "use crate::a;")]),
        ["a", "b", "c"]
    );
    // What leads into a circle is none, and neither are a parent with its children, nor tests.
    let leads = ("c", "use crate::a::A;");
    assert_eq!(of(&[root, a, ("b", "use crate::a::A;"), leads]), ["a", "b"]);
    assert!(of(&[root, a, ("b", "#[cfg(test)] mod tests { use crate::a::A; }")]).is_empty());
    assert!(of(&[root, ("a", "mod x; use x::X;"), ("a::x", "use super::Y;")]).is_empty());
    assert!(of(&[root, a, ("b", "use other::a::A;")]).is_empty());
}
