//! The rules about which crate may import which, checked against `cargo metadata`.
//!
//! The rules are the table [`RULES`]. `ARCHITECTURE.md` has the reasons.

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
    /// Test equipment: allowed only under `[dev-dependencies]`, except where a rule allows more.
    Testkit,
}

/// What one crate of the workspace may depend on, apart from its own tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rule {
    /// The crate of the rule.
    pub package: &'static str,
    /// The layer of the crate.
    pub layer: Layer,
    /// The crates of this workspace that it may use.
    pub may_use: &'static [&'static str],
}

/// One rule for each crate of the workspace; a crate without a rule is a violation.
pub const RULES: &[Rule] = &[
    Rule { package: "r6-proto", layer: Layer::Pure, may_use: &[] },
    Rule { package: "r6-traffic", layer: Layer::Pure, may_use: &["r6-proto"] },
    // Model files are read like all other files that people write. This crate uses nothing else of the
    // protocol.
    Rule { package: "r6-motion", layer: Layer::Pure, may_use: &["r6-program"] },
    Rule { package: "r6-program", layer: Layer::Pure, may_use: &["r6-proto"] },
    Rule {
        package: "r6-controller",
        layer: Layer::Pure,
        may_use: &["r6-motion", "r6-program", "r6-proto", "r6-traffic"],
    },
    // The contract: readers of a robot hand over its values by address.
    Rule { package: "r6-api", layer: Layer::Pure, may_use: &["r6-proto"] },
    // HTTP servers: everything that they serve comes as a router.
    Rule { package: "r6-http", layer: Layer::Shell, may_use: &["r6-api", "r6-proto"] },
    // A robot is reached only over the wire, so the client cannot know that it is simulated.
    Rule { package: "r6-client", layer: Layer::Shell, may_use: &["r6-proto"] },
    // Its own sources are pure (`tests/layers.rs`). It is a shell because it uses the client.
    Rule {
        package: "r6-plot",
        layer: Layer::Shell,
        may_use: &["r6-client", "r6-controller", "r6-motion", "r6-program", "r6-proto"],
    },
    // The simulator is the other end of the wire. It shares only the protocol with the client.
    Rule {
        package: "r6-sim",
        layer: Layer::Shell,
        may_use: &["r6-api", "r6-controller", "r6-http", "r6-proto", "r6-traffic"],
    },
    // A robot is reached only over the wire, so the gateway knows no simulator. It plans programs as
    // `r6 plot` does.
    Rule {
        package: "r6-gateway",
        layer: Layer::Shell,
        may_use: &["r6-api", "r6-client", "r6-http", "r6-motion", "r6-plot", "r6-program", "r6-proto"],
    },
    // It sends the spans of any program.
    Rule { package: "r6-traces", layer: Layer::Shell, may_use: &[] },
    Rule {
        package: "r6",
        layer: Layer::Shell,
        may_use: &[
            "r6-api",
            "r6-client",
            "r6-controller",
            "r6-gateway",
            "r6-plot",
            "r6-program",
            "r6-proto",
            "r6-sim",
            "r6-traces",
            "r6-traffic",
        ],
    },
    // Only this crate binds both sides, so that a Python program can start its own virtual controller.
    Rule {
        package: "r6-python",
        layer: Layer::Shell,
        may_use: &["r6-api", "r6-client", "r6-controller", "r6-plot", "r6-program", "r6-proto", "r6-sim"],
    },
    // No crate depends on it, and it is not shipped. It may use everything, and it counts allocations as
    // tests do.
    Rule {
        package: "r6-bench",
        layer: Layer::Shell,
        may_use: &[
            "r6-api",
            "r6-client",
            "r6-controller",
            "r6-gateway",
            "r6-motion",
            "r6-proto",
            "r6-sim",
            "r6-testkit",
        ],
    },
    // Only the programs of `fuzz/`, a separate workspace, depend on it.
    Rule {
        package: "r6-fuzz",
        layer: Layer::Shell,
        may_use: &["r6-api", "r6-client", "r6-controller", "r6-program", "r6-proto", "r6-sim", "r6-traffic"],
    },
    // The same. It has both ends in one process, with a gateway between them in some worlds, and breaks the
    // links.
    Rule {
        package: "r6-world",
        layer: Layer::Shell,
        may_use: &[
            "r6-api",
            "r6-client",
            "r6-controller",
            "r6-gateway",
            "r6-http",
            "r6-motion",
            "r6-proto",
            "r6-sim",
            "r6-traffic",
        ],
    },
    Rule { package: "r6-testkit", layer: Layer::Testkit, may_use: &[] },
];

/// The parts of the standard library that a pure crate may use: values, containers, formatting and
/// comparison. Nothing here waits, communicates, reads a clock, spawns or draws random numbers.
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

/// Libraries that a pure crate may use besides crates of this workspace. They only compute.
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
    /// The name of the package, even if the crate renames it.
    name: String,
    /// `null` for a normal dependency; otherwise `"dev"` or `"build"`.
    kind: Option<String>,
    /// The folder of a crate of this workspace; absent for a crate from a registry.
    path: Option<String>,
}

/// The output of `cargo metadata --no-deps` for this workspace.
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
/// Dependencies of tests are free, because a test of the client needs a simulator. Normal dependencies and
/// those of build scripts must follow the rules, even if they are optional. Panics if `metadata` is not the
/// output of `cargo metadata`.
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
