//! The files of a crate as a tree of modules, and the file of each path.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path as FilePath, PathBuf};

use super::source::{Path, SourceFile};
use crate::run::TaskResult;

/// The largest number of paths to follow for one path: itself, and those of imports.
const MAX_IMPORTS: usize = 16;

/// The path of a module from the crate's root, which has an empty path.
type Module = Vec<String>;

/// The modules of a crate with their files.
pub(crate) struct Tree(BTreeMap<Module, (PathBuf, SourceFile)>);

/// The files that a file uses.
pub(crate) type Uses = BTreeMap<PathBuf, BTreeSet<PathBuf>>;

impl Tree {
    /// Reads a crate from the file of its root, such as `lib.rs`.
    pub(crate) fn read(root: &FilePath) -> TaskResult<Self> {
        let mut tree = Self(BTreeMap::new());
        let folder = root.parent().unwrap_or(root).to_owned();
        tree.add(Module::new(), root.to_owned(), &folder)?;
        Ok(tree)
    }

    /// Adds a module and the modules below it, whose files are in `folder`.
    fn add(&mut self, module: Module, file: PathBuf, folder: &FilePath) -> TaskResult {
        let text = fs::read_to_string(&file).map_err(|why| format!("{}: {why}", file.display()))?;
        let source = SourceFile::parse(&text).map_err(|why| format!("{}: {why}", file.display()))?;
        for name in &source.modules {
            let inner = folder.join(name);
            let [flat, nested] = [inner.with_extension("rs"), inner.join("mod.rs")];
            let child = [module.as_slice(), std::slice::from_ref(name)].concat();
            self.add(child, if flat.exists() { flat } else { nested }, &inner)?;
        }
        self.0.insert(module, (file, source));
        Ok(())
    }

    pub(crate) fn files(&self) -> usize {
        self.0.len()
    }

    /// The files that each file uses. A re-exported import counts only in the files that use it.
    pub(crate) fn uses(&self) -> Uses {
        let mut uses = Uses::new();
        for (module, (file, source)) in &self.0 {
            let imports = source.imports.iter().map(|(_, path)| path);
            let imports = imports.filter(|path| !source.reexports.contains(path));
            let targets =
                imports.chain(&source.paths).filter_map(|path| self.resolve(module, path, MAX_IMPORTS));
            let files = targets.filter_map(|target| self.0.get(&target)).map(|(file, _)| file.clone());
            uses.insert(file.clone(), files.filter(|used| used != file).collect());
        }
        uses
    }

    /// The module with the item at the end of a path in `module`; `None` if the path leads to no module of this crate.
    fn resolve(&self, module: &Module, path: &Path, imports_left: usize) -> Option<Module> {
        let imports_left = imports_left.checked_sub(1)?;
        let (first, mut rest) = path.split_first()?;
        let mut at = module.clone();
        match first.as_str() {
            "crate" => at.clear(),
            "self" => {}
            "super" => at.truncate(at.len().saturating_sub(1)),
            _ => rest = path,
        }
        let is_anchored = rest.len() < path.len();
        while let Some((name, behind)) = rest.split_first() {
            let child = [at.as_slice(), std::slice::from_ref(name)].concat();
            if name == "super" {
                at.pop();
            } else if self.0.contains_key(&child) {
                at = child;
            } else {
                return self.find(&at, name, behind, is_anchored || &at != module, imports_left);
            }
            rest = behind;
        }
        Some(at)
    }

    /// The module that contains `name`, searched from the module `at`.
    fn find(&self, at: &Module, name: &str, behind: &[String], is_ours: bool, left: usize) -> Option<Module> {
        let (_, source) = self.0.get(at)?;
        if source.items.iter().any(|item| item == name) {
            return Some(at.clone());
        }
        if let Some((_, from)) = source.imports.iter().find(|(imported, _)| imported == name) {
            let path = [from.as_slice(), behind].concat();
            return if from.first().is_some_and(|first| first == name) {
                None
            } else {
                self.resolve(at, &path, left)
            };
        }
        for (_, from) in source.imports.iter().filter(|(imported, _)| imported == "*") {
            let target = self.resolve(at, from, left);
            let has_item = |target: &Module| {
                self.0.get(target).is_some_and(|(_, source)| source.items.iter().any(|item| item == name))
            };
            if let Some(target) = target.filter(has_item) {
                return Some(target);
            }
        }
        is_ours.then(|| at.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uses(files: &[(&str, &str)]) -> Vec<(String, Vec<String>)> {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        let name = |path: &PathBuf| path.strip_prefix(folder.path()).unwrap().display().to_string();
        let tree = Tree::read(&folder.path().join("lib.rs")).unwrap();
        tree.uses().iter().map(|(file, used)| (name(file), used.iter().map(name).collect())).collect()
    }

    fn entry(file: &str, used: &[&str]) -> (String, Vec<String>) {
        (file.to_owned(), used.iter().map(|&used| used.to_owned()).collect())
    }

    #[test]
    fn a_path_leads_to_the_file_that_defines_its_item() {
        let found = uses(&[
            ("lib.rs", "mod a; mod b; pub use a::A; pub struct Root;"),
            ("a.rs", "use std::fmt; pub struct A;"),
            ("b/mod.rs", "mod c; use crate::A; fn f() { c::g(); fmt::h(); }"),
            ("b/c.rs", "use super::super::Root; pub fn g() {}"),
        ]);
        let expected = [
            entry("a.rs", &[]),
            entry("b/c.rs", &["lib.rs"]),
            entry("b/mod.rs", &["a.rs", "b/c.rs"]),
            entry("lib.rs", &[]),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn imports_by_glob_lead_to_the_file_that_defines_the_item() {
        let found = uses(&[
            ("lib.rs", "mod a; mod b; pub use a::*;"),
            ("a.rs", "pub struct A;"),
            ("b.rs", "use crate::A;"),
        ]);
        assert_eq!(found[1], entry("b.rs", &["a.rs"]));
    }
}
