//! `cargo xtask deny`: checks licences, versions and sources of all dependencies against `deny.toml`.
//!
//! The file has the format of cargo-deny. It contains only keys that are checked here: any other key is an error. So
//! every test run makes these checks without installing cargo-deny. Only the security advisories need cargo-deny and
//! its database.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::process::{Command, Stdio};

use serde::Deserialize;
use spdx::{Expression, LicenseReq};

use crate::run::{TaskResult, cargo, root};
use crate::workspace::{Dependency, Package, metadata};

/// The workspaces whose dependencies are checked.
const MANIFESTS: [&str; 2] = ["Cargo.toml", "verification/fuzz/Cargo.toml"];

/// The contents of `deny.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DenyRules {
    graph: Graph,
    licenses: Licenses,
    bans: Bans,
    sources: Sources,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Graph {
    targets: Vec<String>,
    #[serde(rename = "all-features")]
    all_features: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Licenses {
    allow: Vec<String>,
    exceptions: Vec<Exception>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Exception {
    #[serde(rename = "crate")]
    name: String,
    allow: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Bans {
    #[serde(rename = "multiple-versions")]
    _multiple_versions: Warn,
    #[serde(rename = "wildcards")]
    _wildcards: Deny,
    allow_wildcard_paths: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct Sources {
    #[serde(rename = "unknown-registry")]
    _unknown_registry: Deny,
    #[serde(rename = "unknown-git")]
    _unknown_git: Deny,
    allow_registry: Vec<String>,
}

/// The only value of `multiple-versions` that is implemented here.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Warn {
    Warn,
}

/// The only value of `wildcards`, `unknown-registry` and `unknown-git` that is implemented here.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Deny {
    Deny,
}

/// Checks licences, versions and sources.
pub(crate) fn rules() -> TaskResult {
    let rules: DenyRules = toml::from_str(&fs::read_to_string(root().join("deny.toml"))?)?;
    let packages = packages(&rules.graph)?;
    for duplicate in duplicates(&packages) {
        println!("warning: more than one version of {duplicate}");
    }
    let violations = rules.violations(&packages);
    if violations.is_empty() {
        println!("{} packages: licences, versions and sources follow deny.toml", packages.len());
        Ok(())
    } else {
        Err(format!("deny.toml forbids:\n{}", violations.join("\n")).into())
    }
}

/// Checks licences, versions and sources, and the advisories if cargo-deny and its database are available.
pub(crate) fn check() -> TaskResult {
    rules()?;
    if succeeds("deny fetch db") {
        cargo("deny check --disable-fetch advisories")
    } else {
        println!("advisories: NOT CHECKED, cargo-deny is not installed or its database cannot be downloaded");
        Ok(())
    }
}

fn succeeds(words: &str) -> bool {
    let mut program = Command::new("cargo");
    program.args(words.split(' ')).current_dir(root()).stdout(Stdio::null()).stderr(Stdio::null());
    program.status().is_ok_and(|status| status.success())
}

/// The packages in the builds for all targets, each version once, including our own packages.
fn packages(graph: &Graph) -> TaskResult<Vec<Package>> {
    let mut found = BTreeMap::new();
    for manifest in MANIFESTS {
        for target in &graph.targets {
            let mut arguments = vec!["--manifest-path", manifest, "--filter-platform", target];
            arguments.extend(graph.all_features.then_some("--all-features"));
            let named = |package: Package| ((package.name.clone(), package.version.clone()), package);
            found.extend(metadata(&arguments)?.packages.into_iter().map(named));
        }
    }
    Ok(found.into_values().collect())
}

/// Names with more than one version.
fn duplicates(packages: &[Package]) -> BTreeSet<&str> {
    let mut seen = BTreeSet::new();
    packages.iter().map(|package| package.name.as_str()).filter(|name| !seen.insert(*name)).collect()
}

impl DenyRules {
    /// The violations of the rules, one line each.
    fn violations(&self, packages: &[Package]) -> Vec<String> {
        let of_package = |package: &Package| {
            let violations = [self.license(package), self.source(package), self.wildcard(package)];
            let name = format!("{} {}", package.name, package.version);
            violations.into_iter().flatten().map(move |violation| format!("{name}: {violation}"))
        };
        let unused = |exception: &&Exception| !packages.iter().any(|package| package.name == exception.name);
        let unused = self.licenses.exceptions.iter().filter(unused);
        let unused = unused.map(|exception| format!("the exception for {} has no crate", exception.name));
        packages.iter().flat_map(of_package).chain(unused).collect()
    }

    /// The violation, if the licence is allowed neither for all crates nor for this one.
    fn license(&self, package: &Package) -> Option<String> {
        let Some(license) = &package.license else {
            return Some("has no licence".to_owned());
        };
        let Ok(expression) = Expression::parse_mode(license, spdx::ParseMode::LAX) else {
            return Some(format!("`{license}` is no licence expression"));
        };
        let exceptions = self.licenses.exceptions.iter().filter(|exception| exception.name == package.name);
        let exceptions = exceptions.flat_map(|exception| &exception.allow);
        let allowed: Vec<_> = self.licenses.allow.iter().chain(exceptions).collect();
        let is_allowed = |wanted: &LicenseReq| allowed.iter().any(|allowed| **allowed == wanted.to_string());
        (!expression.evaluate(is_allowed)).then(|| format!("licence `{license}` is not allowed"))
    }

    /// The violation, if a dependency does not come from an allowed registry. No git repository is allowed.
    fn source(&self, package: &Package) -> Option<String> {
        let source = package.source.as_ref()?;
        let registry = source.strip_prefix("registry+").or_else(|| source.strip_prefix("sparse+"));
        let is_allowed = registry
            .is_some_and(|registry| self.sources.allow_registry.iter().any(|allowed| allowed == registry));
        (!is_allowed).then(|| format!("source `{source}` is not allowed"))
    }

    /// The violation, if a package of ours allows any version (`*`) of a dependency. `allow-wildcard-paths` exempts folders.
    fn wildcard(&self, package: &Package) -> Option<String> {
        let is_exempt =
            |dependency: &&Dependency| dependency.path.is_some() && self.bans.allow_wildcard_paths;
        let mut wild = package.dependencies.iter().filter(|dependency| dependency.req == "*");
        let violation = wild.find(|dependency| package.source.is_none() && !is_exempt(dependency))?;
        Some(format!("takes any version of {}", violation.name))
    }
}

#[cfg(test)]
#[allow(clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    const CRATES_IO: &str = "registry+https://github.com/rust-lang/crates.io-index";

    fn rules() -> DenyRules {
        toml::from_str(&fs::read_to_string(root().join("deny.toml")).unwrap()).unwrap()
    }

    fn package(license: Option<&str>, source: Option<&str>) -> Package {
        Package {
            name: "example".to_owned(),
            version: "1.0.0".to_owned(),
            license: license.map(str::to_owned),
            source: source.map(str::to_owned),
            ..Package::default()
        }
    }

    #[test]
    fn a_licence_is_allowed_when_its_expression_can_be_met() {
        let rules = rules();
        let violation = |license| rules.license(&package(license, Some(CRATES_IO)));
        for allowed in ["MIT", "MIT OR GPL-3.0-only", "MIT/Apache-2.0", "Apache-2.0 AND MIT"] {
            assert_eq!(violation(Some(allowed)), None, "{allowed}");
        }
        for refused in ["GPL-3.0-only", "MIT AND GPL-3.0-only", "MPL-2.0", "Apache-2.0 WITH LLVM-exception"] {
            assert!(violation(Some(refused)).unwrap().contains("is not allowed"), "{refused}");
        }
        assert!(violation(Some("ask me")).unwrap().contains("is no licence expression"));
        assert!(violation(None).unwrap().contains("has no licence"));
    }

    #[test]
    fn an_exception_is_for_its_crate_only_and_has_to_be_used() {
        let rules = rules();
        let mut serialport = package(Some("MPL-2.0"), Some(CRATES_IO));
        assert!(rules.license(&serialport).is_some());
        serialport.name = "serialport".to_owned();
        assert_eq!(rules.license(&serialport), None);
        let violations = rules.violations(&[serialport]);
        assert!(violations.iter().any(|violation| violation.contains("for foldhash")), "{violations:?}");
        assert!(!violations.iter().any(|violation| violation.contains("serialport")), "{violations:?}");
    }

    #[test]
    fn sources_are_crates_io_and_this_repository() {
        let rules = rules();
        let violation = |source| rules.source(&package(Some("MIT"), source));
        assert_eq!(violation(Some(CRATES_IO)), None);
        assert_eq!(violation(None), None);
        assert!(violation(Some("git+https://example.org/x#1")).is_some());
        assert!(violation(Some("registry+https://example.org/index")).is_some());
    }

    #[test]
    fn a_dependency_on_any_version_is_refused_unless_it_is_a_folder() {
        let rules = rules();
        let mut ours = package(Some("MIT"), None);
        let any = Dependency { name: "any".to_owned(), req: "*".to_owned(), ..Dependency::default() };
        ours.dependencies = vec![Dependency { path: Some("any".into()), ..any.clone() }];
        assert_eq!(rules.wildcard(&ours), None);
        ours.dependencies.push(any);
        assert!(rules.wildcard(&ours).is_some());
    }

    #[test]
    fn a_key_that_is_not_checked_is_refused() {
        let text = fs::read_to_string(root().join("deny.toml")).unwrap();
        assert!(
            toml::from_str::<DenyRules>(&text.replace("wildcards = \"deny\"", "wildcards = \"warn\""))
                .is_err()
        );
        assert!(toml::from_str::<DenyRules>(&format!("{text}\nprivate = true\n")).is_err());
    }

    #[test]
    fn two_versions_of_one_crate_are_reported() {
        let (first, mut second) = (package(None, None), package(None, None));
        assert!(duplicates(std::slice::from_ref(&first)).is_empty());
        second.version = "2.0.0".to_owned();
        assert_eq!(duplicates(&[first, second]).into_iter().collect::<Vec<_>>(), ["example"]);
    }
}
