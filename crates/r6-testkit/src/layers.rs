//! Who may import whom, checked against `cargo metadata`.
//!
//! The rules are the table [`RULES`]; the reasons stand in `ARCHITECTURE.md`.

use std::env;
use std::process::Command;

use serde::Deserialize;

use crate::workspace;

/// Whether a crate may do input and output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layer {
    /// No clock, socket, task, file or environment: bytes and times come in, bytes and deadlines go out.
    Pure,
    /// A shell around pure crates.
    Shell,
    /// Test equipment: named under `[dev-dependencies]` only, but for the rules that allow it.
    Testkit,
}

/// What one crate of the workspace may depend on, outside its own tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rule {
    /// The crate the rule is about.
    pub package: &'static str,
    /// What kind of crate it is.
    pub layer: Layer,
    /// The crates of this workspace it may name.
    pub may_use: &'static [&'static str],
}

/// One rule for each crate of the workspace; a crate without a rule is a violation.
pub const RULES: &[Rule] = &[
    Rule { package: "r6-proto", layer: Layer::Pure, may_use: &[] },
    Rule { package: "r6-traffic", layer: Layer::Pure, may_use: &["r6-proto"] },
    // Files of models are read as all files that people write; nothing else of the protocol is known here.
    Rule { package: "r6-motion", layer: Layer::Pure, may_use: &["r6-program"] },
    Rule { package: "r6-program", layer: Layer::Pure, may_use: &["r6-proto"] },
    Rule {
        package: "r6-controller",
        layer: Layer::Pure,
        may_use: &["r6-motion", "r6-program", "r6-proto", "r6-traffic"],
    },
    // The contract: whoever reads a robot hands over its values by address.
    Rule { package: "r6-api", layer: Layer::Pure, may_use: &["r6-proto"] },
    // HTTP servers: whatever is served comes as a router.
    Rule { package: "r6-http", layer: Layer::Shell, may_use: &["r6-api", "r6-proto"] },
    // A robot is only ever reached over the wire: the client cannot know that one is simulated.
    Rule { package: "r6-client", layer: Layer::Shell, may_use: &["r6-proto"] },
    // It does no input and output (`tests/layers.rs`), but the client, whose motions it plays, is a shell.
    Rule {
        package: "r6-plot",
        layer: Layer::Shell,
        may_use: &["r6-client", "r6-controller", "r6-motion", "r6-program", "r6-proto"],
    },
    // The simulator is the other end of the wire and shares nothing with the client but the protocol.
    Rule {
        package: "r6-sim",
        layer: Layer::Shell,
        may_use: &["r6-api", "r6-controller", "r6-http", "r6-proto", "r6-traffic"],
    },
    Rule {
        package: "r6",
        layer: Layer::Shell,
        may_use: &[
            "r6-api",
            "r6-client",
            "r6-controller",
            "r6-plot",
            "r6-program",
            "r6-proto",
            "r6-sim",
            "r6-traffic",
        ],
    },
    // This crate alone binds both sides: a Python program brings its own virtual controller.
    Rule {
        package: "r6-python",
        layer: Layer::Shell,
        may_use: &["r6-api", "r6-client", "r6-controller", "r6-plot", "r6-program", "r6-proto", "r6-sim"],
    },
    // Nothing depends on it and nobody is given it; it looks at everything, and counts allocations as tests do.
    Rule {
        package: "r6-bench",
        layer: Layer::Shell,
        may_use: &["r6-client", "r6-controller", "r6-motion", "r6-proto", "r6-sim", "r6-testkit"],
    },
    // Nothing depends on it but the programs of `fuzz/`, a workspace of their own.
    Rule {
        package: "r6-fuzz",
        layer: Layer::Shell,
        may_use: &["r6-api", "r6-client", "r6-controller", "r6-program", "r6-proto", "r6-sim", "r6-traffic"],
    },
    // The same: it has both ends in one process, and breaks what is between them.
    Rule {
        package: "r6-world",
        layer: Layer::Shell,
        may_use: &["r6-client", "r6-controller", "r6-motion", "r6-proto", "r6-sim", "r6-traffic"],
    },
    Rule { package: "r6-testkit", layer: Layer::Testkit, may_use: &[] },
];

/// What a pure crate may name of the standard library: values, and how they are kept, shown and compared. Nothing here waits, talks,
/// reads a clock, spawns or draws random numbers.
pub const PURE_STD: &[&str] = &[
    "std::borrow",
    "std::cell",
    "std::cmp",
    "std::collections::BTreeMap",
    "std::collections::BTreeSet",
    "std::collections::VecDeque",
    "std::error",
    "std::f64",
    "std::fmt",
    "std::iter",
    "std::mem",
    "std::ops",
    "std::str",
    "std::sync::Arc",
    "std::sync::LazyLock",
    "std::time::Duration",
];

/// Libraries that a pure crate may use besides crates of this workspace: they compute.
pub const PURE_LIBRARIES: &[&str] = &[
    "encoding_rs",
    "nalgebra",
    "rs-opw-kinematics",
    "serde",
    "serde_json",
    "serde_path_to_error",
    "strsim",
    "toml",
    "utoipa",
];

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    dependencies: Vec<Dependency>,
}

#[derive(Deserialize)]
struct Dependency {
    /// The name of the package, whatever the crate calls it for itself.
    name: String,
    /// `null` for a normal dependency, else `"dev"` or `"build"`.
    kind: Option<String>,
    /// The folder of a crate of this workspace; no such member for a crate of a registry.
    path: Option<String>,
}

/// What `cargo metadata --no-deps` says of this workspace.
pub fn metadata() -> String {
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--no-deps", "--manifest-path"])
        .arg(workspace::root().join("Cargo.toml"))
        .output()
        .unwrap_or_else(|error| panic!("cannot run cargo metadata: {error}"));
    assert!(output.status.success(), "cargo metadata failed: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("cargo metadata writes UTF-8")
}

/// Every edge of `metadata` that breaks a rule, each as one sentence.
///
/// Dependencies of the tests are free, for a test of the client needs a simulator; normal ones and those of build
/// scripts are not, whether optional or not. Panics where `metadata` is not what `cargo metadata` prints.
pub fn violations(metadata: &str) -> Vec<String> {
    let metadata: Metadata = serde_json::from_str(metadata)
        .unwrap_or_else(|error| panic!("not the output of cargo metadata: {error}"));
    metadata.packages.iter().flat_map(violations_of).collect()
}

fn violations_of(package: &Package) -> Vec<String> {
    let Some(rule) = rule(&package.name) else {
        return vec![format!("`{}` has no rule: add one to layers::RULES", package.name)];
    };
    package
        .dependencies
        .iter()
        .filter(|dependency| dependency.kind.as_deref() != Some("dev"))
        .filter_map(|dependency| Some((dependency, complaint(rule, dependency)?)))
        .map(|(dependency, complaint)| {
            format!("`{}` depends on `{}`: {complaint}", package.name, dependency.name)
        })
        .collect()
}

fn rule(package: &str) -> Option<&'static Rule> {
    RULES.iter().find(|rule| rule.package == package)
}

fn complaint(rule: &Rule, dependency: &Dependency) -> Option<&'static str> {
    let name = dependency.name.as_str();
    let target = self::rule(name);
    let is_named = rule.may_use.contains(&name);
    if target.is_some_and(|target| target.layer == Layer::Testkit) && !is_named {
        return Some("test equipment belongs under [dev-dependencies]");
    }
    if target.is_some() || dependency.path.is_some() {
        return (!is_named).then_some("its rule does not allow this crate");
    }
    let is_allowed = rule.layer != Layer::Pure || PURE_LIBRARIES.contains(&name);
    (!is_allowed).then_some("not one of the libraries that a pure crate may use (layers::PURE_LIBRARIES)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_name_only_crates_that_have_rules_and_no_shell_is_below_a_pure_crate() {
        for rule in RULES {
            for used in rule.may_use {
                let target = self::rule(used).unwrap_or_else(|| panic!("`{used}` has no rule"));
                assert!(
                    rule.layer != Layer::Pure || target.layer == Layer::Pure,
                    "the pure `{}` may use `{used}`",
                    rule.package
                );
            }
        }
    }

    #[test]
    #[should_panic(expected = "not the output of cargo metadata")]
    fn other_text_is_refused() {
        violations("{}");
    }
}
