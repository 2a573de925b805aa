//! Finds which files of a crate import each other, and what they name from other crates, from their text.
//!
//! Comments, strings and items under `#[cfg(test)]` do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::workspace;

/// The source files of one crate.
#[derive(Debug)]
pub struct Sources {
    /// The paths that each file names, by the module of the file: `lib`, `robot`, `robot::requests`.
    paths: BTreeMap<String, Vec<Vec<String>>>,
}

impl Sources {
    /// The files below `src` of this package in the workspace.
    pub fn of_package(package: &str) -> Self {
        let src = workspace::root().join("crates").join(package).join("src");
        let files = workspace::files(&src, "rs");
        assert!(!files.is_empty(), "there is no source in {}", src.display());
        Self::of(files.iter().map(|file| {
            let path = file.strip_prefix(&src).unwrap_or(file);
            (path, workspace::read(file))
        }))
    }

    /// These files: each with its path below `src` and its text.
    pub fn of<P: AsRef<Path>, T: AsRef<str>>(files: impl IntoIterator<Item = (P, T)>) -> Self {
        let module = |path: &Path| {
            let parts = path.with_extension("");
            parts.iter().map(|part| part.to_string_lossy()).collect::<Vec<_>>().join("::")
        };
        let paths = files
            .into_iter()
            .map(|(path, text)| (module(path.as_ref()), paths(&without_tests(tokens(text.as_ref())))));
        Self { paths: paths.collect() }
    }

    /// The circles of more than `most` files that import each other. Each is one sentence with its edges.
    /// Imports between a parent and its children do not count.
    pub fn circles_of_more_than(&self, most: usize) -> Vec<String> {
        let imports: BTreeMap<&str, BTreeSet<&str>> =
            self.paths.keys().map(|module| (module.as_str(), self.imports_of(module))).collect();
        let reached: BTreeMap<&str, BTreeSet<&str>> =
            imports.keys().map(|module| (*module, reached_from(module, &imports))).collect();
        let circle_of = |module: &str| -> Vec<&str> {
            reached[module].iter().copied().filter(|other| reached[other].contains(module)).collect()
        };
        let circles: BTreeSet<Vec<&str>> = imports.keys().map(|module| circle_of(module)).collect();
        let told = |circle: &Vec<&str>| {
            let edges = circle.iter().map(|module| {
                let within: Vec<&str> =
                    imports[module].iter().copied().filter(|other| circle.contains(other)).collect();
                format!("\n  {module} imports {}", within.join(", "))
            });
            format!("{} files import each other in a circle:{}", circle.len(), edges.collect::<String>())
        };
        circles.iter().filter(|circle| circle.len() > most).map(told).collect()
    }

    /// Names below these roots (`std`, `tokio`) that are not allowed, each as one sentence. A name is allowed
    /// if it begins with an allowed path, such as `["std::fmt"]`; a whole module around an allowed path is
    /// not. `exempt`: files, and folders with everything in them, by their modules.
    pub fn names_outside(&self, roots: &[&str], allowed: &[&str], exempt: &[&str]) -> Vec<String> {
        let allowed: Vec<Vec<&str>> = allowed.iter().map(|path| path.split("::").collect()).collect();
        let is_exempt = |module: &str| {
            exempt.iter().any(|exempt| {
                module.strip_prefix(exempt).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
            })
        };
        let is_allowed = |path: &[String]| {
            let begins = |allowed: &Vec<&str>| {
                path.len() >= allowed.len() && path.iter().zip(allowed).all(|(part, allowed)| part == allowed)
            };
            !roots.contains(&path[0].as_str()) || allowed.iter().any(begins)
        };
        let mut found = Vec::new();
        for (module, paths) in self.paths.iter().filter(|(module, _)| !is_exempt(module)) {
            let named = paths.iter().filter(|path| !is_allowed(path));
            found.extend(named.map(|path| format!("`{module}` names `{}`", path.join("::"))));
        }
        found
    }

    /// The files that this one imports, without its parents and children. An item that `lib.rs` exports
    /// counts as imported from the file that `lib.rs` takes it from.
    fn imports_of(&self, module: &str) -> BTreeSet<&str> {
        let paths = self.paths[module].iter().filter(|_| module != "lib");
        let files = paths.filter_map(|path| self.file_of(&from_root(path, module)));
        let is_within = |file: &str, parent: &str| {
            file.strip_prefix(parent).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
        };
        files.filter(|file| *file != "lib" && !is_within(file, module) && !is_within(module, file)).collect()
    }

    /// The file that a path from the root of the crate leads to.
    fn file_of(&self, path: &[String]) -> Option<&str> {
        let exported = |name: &String| self.paths.get("lib")?.iter().find(|path| path.last() == Some(name));
        let path = match path {
            [name] => exported(name).map_or(path, Vec::as_slice),
            path => path,
        };
        let file = |length: usize| self.paths.get_key_value(&path[..length].join("::"));
        (1..=path.len()).rev().find_map(file).map(|(module, _)| module.as_str())
    }
}

/// A path as seen from the root of its crate.
fn from_root(path: &[String], module: &str) -> Vec<String> {
    let mut from: Vec<String> = module.split("::").map(str::to_owned).collect();
    let mut rest = path;
    match path {
        [first, others @ ..] if first == "crate" => (from, rest) = (Vec::new(), others),
        [first, others @ ..] if first == "self" => rest = others,
        _ => {
            while let [first, others @ ..] = rest
                && first == "super"
            {
                from.pop();
                rest = others;
            }
        }
    }
    from.extend_from_slice(rest);
    from
}

/// The modules that can be reached over one edge or more.
fn reached_from<'a>(module: &str, imports: &BTreeMap<&'a str, BTreeSet<&'a str>>) -> BTreeSet<&'a str> {
    let mut reached = BTreeSet::new();
    let mut open: Vec<&str> = imports[module].iter().copied().collect();
    while let Some(next) = open.pop() {
        if reached.insert(next) {
            open.extend(&imports[next]);
        }
    }
    reached
}

/// The words and punctuation of a source, without comments and strings.
fn tokens(text: &str) -> Vec<String> {
    let is_word = |symbol: char| symbol.is_alphanumeric() || symbol == '_';
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(symbol) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            block_comment(rest)
        } else if let Some(length) = raw_string(rest).or_else(|| quoted(rest)) {
            length
        } else if is_word(symbol) {
            let length = rest.find(|symbol| !is_word(symbol)).unwrap_or(rest.len());
            tokens.push(rest[..length].to_owned());
            length
        } else {
            let length = if rest.starts_with("::") { 2 } else { symbol.len_utf8() };
            if !symbol.is_whitespace() {
                tokens.push(rest[..length].to_owned());
            }
            length
        };
        rest = &rest[length..];
    }
    tokens
}

/// The length of the block comment at the beginning of the text. Block comments nest.
fn block_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0_usize, 0);
    while at < text.len() {
        let rest = &text[at..];
        if rest.starts_with("/*") {
            (depth, at) = (depth + 1, at + 2);
        } else if rest.starts_with("*/") {
            (depth, at) = (depth - 1, at + 2);
        } else {
            at += rest.chars().next().map_or(1, char::len_utf8);
        }
        if depth == 0 {
            return at;
        }
    }
    text.len()
}

/// The length of the raw string at the beginning of the text, if there is one.
fn raw_string(text: &str) -> Option<usize> {
    let prefix = ["r", "br", "cr"].into_iter().find(|prefix| {
        text.strip_prefix(prefix).is_some_and(|rest| rest.trim_start_matches('#').starts_with('"'))
    })?;
    let hashes = text[prefix.len()..].find('"')?;
    let begins = prefix.len() + hashes + 1;
    let end = format!("\"{}", "#".repeat(hashes));
    Some(text[begins..].find(&end).map_or(text.len(), |length| begins + length + end.len()))
}

/// The length of the string or character at the beginning of the text, if there is one. A lifetime does not
/// count.
fn quoted(text: &str) -> Option<usize> {
    let mut symbols = text.char_indices();
    let (_, quote) = symbols.next()?;
    let is_character = || text.starts_with("'\\") || text.chars().nth(2) == Some('\'');
    if quote != '"' && !(quote == '\'' && is_character()) {
        return None;
    }
    while let Some((at, symbol)) = symbols.next() {
        if symbol == '\\' {
            symbols.next();
        } else if symbol == quote {
            return Some(at + 1);
        }
    }
    Some(text.len())
}

/// Removes each item under `#[cfg(test)]`.
fn without_tests(tokens: Vec<String>) -> Vec<String> {
    const TEST: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut kept = Vec::new();
    let mut at = 0;
    while let Some(token) = tokens.get(at) {
        if tokens[at..].iter().zip(TEST).filter(|(token, test)| token == test).count() == TEST.len() {
            at += TEST.len();
            at += item(&tokens[at..]);
        } else {
            kept.push(token.clone());
            at += 1;
        }
    }
    kept
}

/// The number of tokens of an item: up to its semicolon, or to its closing brace.
fn item(tokens: &[String]) -> usize {
    let mut depth = 0_usize;
    for (at, token) in tokens.iter().enumerate() {
        match token.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" if depth == 1 => return at + 1,
            "}" | ")" | "]" => depth = depth.saturating_sub(1),
            ";" if depth == 0 => return at + 1,
            _ => {}
        }
    }
    tokens.len()
}

/// The paths of more than one part. A `use` with braces gives one path for each name.
fn paths(tokens: &[String]) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        if is_name(tokens, at) && is(tokens, at + 1, "::") && !(at > 1 && is(tokens, at - 1, "::")) {
            at = path(tokens, at, &[], &mut found);
        } else {
            at += 1;
        }
    }
    found
}

fn is(tokens: &[String], at: usize, wanted: &str) -> bool {
    tokens.get(at).is_some_and(|token| token == wanted)
}

fn is_name(tokens: &[String], at: usize) -> bool {
    tokens
        .get(at)
        .is_some_and(|token| token.starts_with(|symbol: char| symbol.is_alphabetic() || symbol == '_'))
}

/// Reads the path that begins here, below `prefix`. Returns where it ends.
fn path(tokens: &[String], mut at: usize, prefix: &[String], found: &mut Vec<Vec<String>>) -> usize {
    let mut path = prefix.to_vec();
    while is_name(tokens, at) {
        if path.is_empty() || !is(tokens, at, "self") {
            path.push(tokens[at].clone());
        }
        if !is(tokens, at + 1, "::") {
            at += 1;
            break;
        }
        at += 2;
        if is(tokens, at, "{") {
            at += 1;
            while at < tokens.len() && !is(tokens, at, "}") {
                at = match tokens[at].as_str() {
                    "as" => at + 2,
                    "," => at + 1,
                    _ => self::path(tokens, at, &path, found).max(at + 1),
                };
            }
            return at + 1;
        }
    }
    found.push(path);
    // A star stands for everything in the module, so it counts as naming the module itself.
    if is(tokens, at, "*") { at + 1 } else { at }
}
