//! Files of a crate and the uses between them, from the syntax tree. Code under `#[cfg(test)]` is left out.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Item, Token, UseTree, Visibility};

use crate::harness::top;

/// A library or program: one source per module that has a file of its own.
pub struct Crate {
    pub sources: Vec<Source>,
}

/// Source file of a crate.
#[derive(Default)]
pub struct Source {
    /// Path from the top of the repository.
    pub path: String,
    pub is_unsafe: bool,
    module: Vec<String>,
    /// Names of the items defined here.
    items: BTreeSet<String>,
    uses: Vec<Use>,
    /// Paths in expressions, types and patterns.
    mentions: BTreeSet<Vec<String>>,
    /// Public types and traits that are defined here.
    pub types: BTreeSet<String>,
    /// Types that have methods here.
    implemented: BTreeSet<String>,
}

/// One name brought in by a `use`. The name of `use a::*` is `*`.
struct Use {
    name: String,
    path: Vec<String>,
    is_reexport: bool,
}

impl Crate {
    pub fn read(root: &Path) -> Self {
        let mut sources = vec![];
        read_module(root, &[], &mut sources);
        Self { sources }
    }

    /// Returns the cyclic dependencies among the children of a folder, as text. A child is a file, or a folder with all
    /// its files; the file that declares the children is one of them.
    pub fn circles(&self) -> BTreeSet<String> {
        let arrows = self.arrows();
        let folders = self.sources.iter().filter_map(|source| source.module.split_last());
        let folders: BTreeSet<&[String]> = folders.map(|(_, folder)| folder).collect();
        folders.iter().flat_map(|folder| self.loops_among_children(folder, &arrows)).collect()
    }

    fn loops_among_children(&self, folder: &[String], arrows: &BTreeSet<(usize, usize)>) -> Vec<String> {
        let child = |i: usize| {
            let module = &self.sources[i].module;
            module.starts_with(folder).then(|| &module[..module.len().min(folder.len() + 1)])
        };
        let between = |(from, to): &(usize, usize)| {
            let ends = (child(*from)?, child(*to)?);
            (ends.0 != ends.1).then_some(ends)
        };
        let children: BTreeSet<(&[String], &[String])> = arrows.iter().filter_map(between).collect();
        let loops =
            |arrow: &&(usize, usize)| between(arrow).is_some_and(|(from, to)| reachable(to, &children).contains(from));
        let text = |(from, to): &(usize, usize)| format!("{} -> {}", self.sources[*from].path, self.sources[*to].path);
        arrows.iter().filter(loops).map(text).collect()
    }

    /// Returns pairs of files: the first uses an item that the second defines. Re-exports are no uses.
    fn arrows(&self) -> BTreeSet<(usize, usize)> {
        let mut arrows = BTreeSet::new();
        for (from, source) in self.sources.iter().enumerate() {
            let uses = source.uses.iter().filter(|u| !u.is_reexport).map(|u| &u.path);
            let homes = uses.chain(&source.mentions).filter_map(|path| self.home(from, path, 8));
            arrows.extend(homes.map(|to| (from, to)));
            // A type's own file depends on other files with methods of the type, because its users may call them.
            let types = source.implemented.iter().filter_map(|name| self.home(from, std::slice::from_ref(name), 8));
            arrows.extend(types.map(|home| (home, from)));
        }
        arrows.retain(|(from, to)| from != to);
        arrows
    }

    /// Finds the file that defines the item `path` in the scope of file `at`; `None` for other crates and for modules.
    fn home(&self, at: usize, path: &[String], depth: usize) -> Option<usize> {
        let source = &self.sources[at];
        let (first, rest) = path.split_first()?;
        let mut module = source.module.clone();
        match first.as_str() {
            "crate" => module.clear(),
            "self" => {}
            "super" => {
                module.pop()?;
                if rest.first().is_some_and(|next| next == "super") {
                    return self.home(self.file(&module)?, rest, depth);
                }
            }
            _ => return self.item(at, path, depth),
        }
        self.item(self.file(&module)?, rest, depth)
    }

    /// Finds the file that defines `path`, seen from the module of the file `at`.
    fn item(&self, at: usize, path: &[String], depth: usize) -> Option<usize> {
        let source = &self.sources[at];
        let (first, rest) = path.split_first()?;
        let child: Vec<String> = source.module.iter().chain([first]).cloned().collect();
        if let Some(child) = self.file(&child) {
            return self.item(child, rest, depth);
        }
        if first == "*" || source.items.contains(first) {
            return Some(at);
        }
        let depth = depth.checked_sub(1)?; // a name that re-exports itself ends here
        let named = source.uses.iter().find(|u| u.name == *first).map(|u| [u.path.as_slice(), rest].concat());
        let globs = source.uses.iter().filter(|u| u.name == "*").map(|u| [&u.path[..u.path.len() - 1], path].concat());
        named.into_iter().chain(globs).find_map(|path| self.home(at, &path, depth))
    }

    fn file(&self, module: &[String]) -> Option<usize> {
        self.sources.iter().position(|source| source.module == module)
    }
}

impl Source {
    /// Returns the paths into other crates.
    pub fn foreign_paths(&self) -> Vec<String> {
        let uses = self.uses.iter().map(|u| &u.path);
        let outside = uses.chain(&self.mentions).filter(|path| !["crate", "self", "super"].contains(&path[0].as_str()));
        outside.map(|path| path.join("::")).collect()
    }
}

fn reachable<T: Ord + Copy>(from: T, arrows: &BTreeSet<(T, T)>) -> BTreeSet<T> {
    let mut reached = BTreeSet::new();
    let mut open = vec![from];
    while let Some(at) = open.pop() {
        let next = arrows.iter().filter(|(from, _)| *from == at).map(|(_, to)| *to);
        open.extend(next.filter(|to| reached.insert(*to)));
    }
    reached
}

/// Reads a file and the files of the modules that it declares.
fn read_module(file: &Path, module: &[String], sources: &mut Vec<Source>) {
    let text = std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let syntax = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let path = file.strip_prefix(top()).expect("below the top").display().to_string();
    let mut source = Source { path, module: module.to_vec(), ..Source::default() };
    source.visit_file(&syntax);
    sources.push(source);
    for item in &syntax.items {
        if let Item::Mod(declared) = item
            && declared.content.is_none()
            && !is_test(&declared.attrs)
        {
            let name = declared.ident.to_string();
            read_module(&file_of(file, &name), &[module, &[name]].concat(), sources);
        }
    }
}

/// Returns the file of the module `name` that `parent` declares.
fn file_of(parent: &Path, name: &str) -> PathBuf {
    let stem = parent.file_stem().expect("a file").to_str().expect("a plain name");
    let folder =
        if ["lib", "main", "mod"].contains(&stem) { parent.with_file_name("") } else { parent.with_extension("") };
    let flat = folder.join(name).with_extension("rs");
    if flat.exists() { flat } else { folder.join(name).join("mod.rs") }
}

fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|a| {
        a.path().is_ident("cfg") && a.parse_args::<syn::Path>().is_ok_and(|condition| condition.is_ident("test"))
    })
}

impl<'ast> Visit<'ast> for Source {
    fn visit_item(&mut self, item: &'ast Item) {
        let (attributes, name): (&[Attribute], _) = match item {
            Item::Const(i) => (&i.attrs, Some(&i.ident)),
            Item::Enum(i) => (&i.attrs, Some(&i.ident)),
            Item::Fn(i) => (&i.attrs, Some(&i.sig.ident)),
            Item::Impl(i) => (&i.attrs, None),
            Item::Macro(i) => (&i.attrs, i.ident.as_ref()),
            Item::Mod(i) => (&i.attrs, i.content.as_ref().map(|_| &i.ident)),
            Item::Static(i) => (&i.attrs, Some(&i.ident)),
            Item::Struct(i) => (&i.attrs, Some(&i.ident)),
            Item::Trait(i) => (&i.attrs, Some(&i.ident)),
            Item::Type(i) => (&i.attrs, Some(&i.ident)),
            Item::Use(i) => (&i.attrs, None),
            _ => (&[], None),
        };
        if is_test(attributes) {
            return;
        }
        self.items.extend(name.map(ToString::to_string));
        let visibility = match item {
            Item::Enum(i) => &i.vis,
            Item::Struct(i) => &i.vis,
            Item::Trait(i) => &i.vis,
            Item::Type(i) => &i.vis,
            _ => &Visibility::Inherited,
        };
        if !matches!(visibility, Visibility::Inherited) {
            self.types.extend(name.map(ToString::to_string));
        }
        visit::visit_item(self, item);
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let is_reexport = !matches!(item.vis, Visibility::Inherited);
        flatten(&item.tree, &mut vec![], &mut |name, path| self.uses.push(Use { name, path, is_reexport }));
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.mentions.insert(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        visit::visit_path(self, path);
    }

    /// Visits the arguments of `assert!`, `format!` and similar macros as expressions.
    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        for argument in call.parse_body_with(Punctuated::<Expr, Token![,]>::parse_terminated).into_iter().flatten() {
            // The tree of the arguments lives only here, which `visit_expr` of this lifetime does not accept.
            let mut inner = Self::default();
            inner.visit_expr(&argument);
            self.mentions.append(&mut inner.mentions);
            self.is_unsafe |= inner.is_unsafe;
        }
    }

    fn visit_expr_unsafe(&mut self, _: &'ast syn::ExprUnsafe) {
        self.is_unsafe = true;
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        self.is_unsafe |= item.unsafety.is_some();
        if let (None, syn::Type::Path(of)) = (&item.trait_, &*item.self_ty)
            && let Some(name) = of.path.get_ident()
        {
            self.implemented.insert(name.to_string());
        }
        visit::visit_item_impl(self, item);
    }
}

/// Calls `found` with the name and the path of each leaf of a `use`.
fn flatten(tree: &UseTree, before: &mut Vec<String>, found: &mut impl FnMut(String, Vec<String>)) {
    let joined = |last: &str| before.iter().cloned().chain([last.to_owned()]).collect();
    match tree {
        UseTree::Path(path) => {
            before.push(path.ident.to_string());
            flatten(&path.tree, before, found);
            before.pop();
        }
        UseTree::Name(name) if name.ident == "self" => {
            found(before.last().cloned().unwrap_or_default(), before.clone());
        }
        UseTree::Name(name) => found(name.ident.to_string(), joined(&name.ident.to_string())),
        UseTree::Rename(rename) => found(rename.rename.to_string(), joined(&rename.ident.to_string())),
        UseTree::Glob(_) => found("*".to_owned(), joined("*")),
        UseTree::Group(group) => group.items.iter().for_each(|tree| flatten(tree, before, found)),
    }
}
