//! Every remedy that stands in the sources of the product.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::{self, Visit};
use syn::{Expr, Lit, Pat, Token, punctuated::Punctuated};

/// Functions that are handed a remedy, and at which place; the last one where there is none.
const TAKES: [(&str, Option<usize>); 9] = [
    ("refuse", None),
    ("refuse_toml", None),
    ("refused", None),
    ("usage", None),
    ("short", None),
    ("unless", Some(2)),
    ("missing", Some(2)),
    ("problem", None),
    ("Defect::new", None),
];

/// Remedies, and the files they stand in.
pub(crate) fn in_sources() -> BTreeMap<String, Vec<PathBuf>> {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("crates/");
    let mut out: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    let mut left = vec![crates.to_owned()];
    while let Some(folder) = left.pop() {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            if path.is_dir() {
                if !["tests", "benches", "examples", "target"].contains(&name.as_str()) {
                    left.push(path);
                }
            } else if name.ends_with(".rs") && name != "tests.rs" {
                let text = fs::read_to_string(&path).expect("a source");
                let file = syn::parse_file(&text).expect("it compiles");
                let mut finder = Finder::default();
                finder.visit_file(&file);
                for remedy in finder.found {
                    out.entry(remedy).or_default().push(path.clone());
                }
            }
        }
    }
    out
}

#[derive(Default)]
struct Finder {
    found: Vec<String>,
}

impl Finder {
    /// The texts that an expression may become.
    fn take(&mut self, e: &Expr) {
        match e {
            Expr::Lit(l) => {
                if let Lit::Str(s) = &l.lit {
                    self.found.extend(Some(s.value()).filter(|s| !s.is_empty()));
                }
            }
            Expr::Macro(m) if m.mac.path.is_ident("format") => {
                let parse = Punctuated::<Expr, Token![,]>::parse_terminated;
                let parts = m.mac.parse_body_with(parse).expect("a format");
                parts.first().into_iter().for_each(|text| self.take(text));
            }
            Expr::MethodCall(c) => {
                self.take(&c.receiver);
                if c.method != "join" {
                    c.args.iter().for_each(|a| self.take(a));
                }
            }
            Expr::Call(c) => c.args.iter().for_each(|a| self.take(a)),
            Expr::Reference(r) => self.take(&r.expr),
            Expr::Paren(p) => self.take(&p.expr),
            Expr::Closure(c) => self.take(&c.body),
            Expr::Block(b) => self.last(&b.block),
            Expr::If(i) => {
                self.last(&i.then_branch);
                i.else_branch.iter().for_each(|(_, e)| self.take(e));
            }
            Expr::Match(m) => m.arms.iter().for_each(|a| self.take(&a.body)),
            Expr::Tuple(t) => t.elems.iter().for_each(|e| self.take(e)),
            _ => {}
        }
    }

    /// What a block becomes.
    fn last(&mut self, block: &syn::Block) {
        if let Some(syn::Stmt::Expr(e, None)) = block.stmts.last() {
            self.take(e);
        }
    }

    /// The argument that is a remedy.
    fn argument(&mut self, name: &str, args: &Punctuated<Expr, Token![,]>) {
        let Some((_, place)) = TAKES.iter().find(|(n, _)| *n == name) else { return };
        let place = place.unwrap_or(args.len().saturating_sub(1));
        args.iter().nth(place).into_iter().for_each(|a| self.take(a));
    }
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|a| {
        a.path().is_ident("test")
            || a.path().is_ident("cfg") && a.parse_args::<syn::Ident>().is_ok_and(|i| i == "test")
    })
}

/// The last two names of a path, or the last.
fn names(path: &syn::Path) -> [String; 2] {
    let all: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
    let last = all.last().cloned().unwrap_or_default();
    [all[all.len().saturating_sub(2)..].join("::"), last]
}

impl<'a> Visit<'a> for Finder {
    fn visit_item_mod(&mut self, m: &'a syn::ItemMod) {
        if !is_test(&m.attrs) {
            visit::visit_item_mod(self, m);
        }
    }

    fn visit_field_value(&mut self, f: &'a syn::FieldValue) {
        if matches!(&f.member, syn::Member::Named(n) if n == "remedy") {
            self.take(&f.expr);
        }
        visit::visit_field_value(self, f);
    }

    fn visit_local(&mut self, l: &'a syn::Local) {
        let named = |p: &Pat| matches!(p, Pat::Ident(i) if i.ident == "remedy");
        let ours = match &l.pat {
            Pat::Tuple(t) => t.elems.iter().any(named),
            p => named(p),
        };
        if ours && let Some(init) = &l.init {
            match (&l.pat, &*init.expr) {
                // (what, remedy) = if … { (…, "…") } …
                (Pat::Tuple(_), Expr::If(i)) => {
                    let mut blocks = vec![&i.then_branch];
                    if let Some((_, e)) = &i.else_branch
                        && let Expr::Block(b) = &**e
                    {
                        blocks.push(&b.block);
                    }
                    for b in blocks {
                        if let Some(syn::Stmt::Expr(Expr::Tuple(t), None)) = b.stmts.last() {
                            t.elems.last().into_iter().for_each(|e| self.take(e));
                        }
                    }
                }
                (_, e) => self.take(e),
            }
        }
        visit::visit_local(self, l);
    }

    fn visit_expr_assign(&mut self, a: &'a syn::ExprAssign) {
        if matches!(&*a.left, Expr::Field(f) if matches!(&f.member, syn::Member::Named(n) if n == "remedy"))
        {
            self.take(&a.right);
        }
        visit::visit_expr_assign(self, a);
    }

    fn visit_item_const(&mut self, c: &'a syn::ItemConst) {
        if c.ident.to_string().contains("REMEDY") {
            self.take(&c.expr);
        }
        visit::visit_item_const(self, c);
    }

    fn visit_item_fn(&mut self, f: &'a syn::ItemFn) {
        if is_test(&f.attrs) {
            return;
        }
        if f.sig.ident.to_string().ends_with("remedy") {
            self.last(&f.block);
        }
        visit::visit_item_fn(self, f);
    }

    fn visit_impl_item_fn(&mut self, f: &'a syn::ImplItemFn) {
        if f.sig.ident == "remedy" {
            self.last(&f.block);
        }
        visit::visit_impl_item_fn(self, f);
    }

    fn visit_expr_call(&mut self, c: &'a syn::ExprCall) {
        if let Expr::Path(p) = &*c.func {
            let [two, one] = names(&p.path);
            let name = if TAKES.iter().any(|(n, _)| *n == two) { two } else { one };
            self.argument(&name, &c.args);
        }
        visit::visit_expr_call(self, c);
    }

    fn visit_expr_method_call(&mut self, c: &'a syn::ExprMethodCall) {
        self.argument(&c.method.to_string(), &c.args);
        visit::visit_expr_method_call(self, c);
    }
}

/// Whether a remedy, as it was given, is that of the sources, where names and numbers stand in braces.
pub(crate) fn is_of(given: &str, source: &str) -> bool {
    let (mut parts, mut part, mut rest) = (Vec::new(), String::new(), source.chars().peekable());
    while let Some(c) = rest.next() {
        match c {
            '{' if rest.peek() == Some(&'{') => part.extend(rest.next()),
            '}' if rest.peek() == Some(&'}') => part.extend(rest.next()),
            '{' => {
                rest.by_ref().find(|c| *c == '}');
                parts.push(core::mem::take(&mut part));
            }
            c => part.push(c),
        }
    }
    let open = !parts.is_empty();
    parts.push(part);
    let (first, last) = (&parts[0], &parts[parts.len() - 1]);
    if !open {
        return given == first;
    }
    let mut at = 0;
    given.starts_with(first.as_str())
        && given.ends_with(last.as_str())
        && parts.iter().all(|p| match given[at..].find(p.as_str()) {
            Some(i) => {
                at += i + p.len();
                true
            }
            None => false,
        })
}

#[test]
fn invariant_remedies_are_found_wherever_they_stand() {
    let found = in_sources();
    for known in [
        "make the petal thinner",
        "save the file as UTF-8",
        "add the key `{key}`",
        "did you mean `{m}`?",
        "a URDF is a tree: remove the joint above the link that is to be its root",
        "add --tolerance 1e-3 or --tol m=1e-3",
        "a leg stands on its limit switch: drive it off by hand",
        "files are never overwritten: give a new one with --out",
    ] {
        assert!(found.contains_key(known), "{known}");
    }
    assert!(found.len() > 150, "{}", found.len());
    assert!(is_of("add [hull] with its keys", "add [{}] with its keys"));
    assert!(!is_of("add [hull]", "add [{}] with its keys"));
    assert!(is_of("write a = { source = \"…\" }", "write {key} = {{ source = \"…\" }}"));
}
