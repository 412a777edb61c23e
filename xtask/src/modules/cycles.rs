//! Cycles in a graph: sets of files that reach each other.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::tree::Uses;

/// The largest sets of two or more files that reach each other.
pub(crate) fn find(uses: &Uses) -> BTreeSet<BTreeSet<PathBuf>> {
    let reach = |from: &Path| reachable(uses, from);
    let reached: Vec<_> = uses.keys().map(|file| (file, reach(file))).collect();
    let cycle_of = |file: &PathBuf, reaches: &BTreeSet<PathBuf>| {
        let back = reached.iter().filter(|(other, back)| reaches.contains(*other) && back.contains(file));
        back.map(|(other, _)| (*other).clone()).collect::<BTreeSet<_>>()
    };
    reached.iter().map(|(file, reaches)| cycle_of(file, reaches)).filter(|cycle| cycle.len() > 1).collect()
}

/// The files that `from` uses directly or indirectly.
fn reachable(uses: &Uses, from: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    let mut pending = vec![from.to_owned()];
    while let Some(file) = pending.pop() {
        for used in uses.get(&file).into_iter().flatten() {
            if found.insert(used.clone()) {
                pending.push(used.clone());
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycles(uses: &[(&str, &[&str])]) -> Vec<Vec<String>> {
        let files = |names: &[&str]| names.iter().map(PathBuf::from).collect();
        let uses = uses.iter().map(|(file, used)| (PathBuf::from(file), files(used))).collect();
        let names = |cycle: BTreeSet<PathBuf>| cycle.iter().map(|file| file.display().to_string()).collect();
        find(&uses).into_iter().map(names).collect()
    }

    #[test]
    fn files_that_reach_each_other_are_a_cycle() {
        assert_eq!(cycles(&[("a", &["b"]), ("b", &["c"]), ("c", &["b"])]), [["b", "c"]]);
        assert_eq!(cycles(&[("a", &["b"]), ("b", &["c"]), ("c", &["a"])]), [["a", "b", "c"]]);
    }

    #[test]
    fn a_tree_has_no_cycle() {
        assert!(cycles(&[("a", &["b", "c"]), ("b", &["c"]), ("c", &[])]).is_empty());
    }
}
