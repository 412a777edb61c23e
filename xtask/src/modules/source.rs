//! A Rust source file: its modules, items, and paths.

use std::iter::Peekable;
use std::mem;
use std::str::FromStr;

use proc_macro2::token_stream::IntoIter;
use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

use crate::run::TaskResult;

/// A path: `["crate", "run", "TaskResult"]`.
pub(crate) type Path = Vec<String>;

/// The contents of a file, without tests.
#[derive(Debug, Default)]
pub(crate) struct SourceFile {
    /// Modules in files of their own: `mod name;`.
    pub(crate) modules: Vec<String>,
    /// Names of defined items.
    pub(crate) items: Vec<String>,
    /// Names that `use` imports, with their paths. The name of a glob import is `*`.
    pub(crate) imports: Vec<(String, Path)>,
    /// The paths of imports that `pub use` re-exports.
    pub(crate) reexports: Vec<Path>,
    /// Other paths.
    pub(crate) paths: Vec<Path>,
}

type Tokens = Peekable<IntoIter>;

/// Keywords before the name of an item.
const ITEMS: [&str; 10] =
    ["const", "enum", "fn", "macro_rules", "mod", "static", "struct", "trait", "type", "union"];

impl SourceFile {
    pub(crate) fn parse(text: &str) -> TaskResult<Self> {
        let mut source = Self::default();
        source.read(TokenStream::from_str(text).map_err(|why| why.to_string())?);
        Ok(source)
    }

    fn read(&mut self, stream: TokenStream) {
        let mut tokens = stream.into_iter().peekable();
        let mut is_public = false;
        while let Some(token) = tokens.next() {
            let was_public = is_public;
            is_public = match &token {
                TokenTree::Ident(word) => word == "pub",
                // `pub(crate)`
                TokenTree::Group(group) => was_public && group.delimiter() == Delimiter::Parenthesis,
                _ => false,
            };
            match token {
                TokenTree::Punct(mark) if mark.as_char() == '#' && skip_test(&mut tokens) => {}
                TokenTree::Ident(word) if word == "use" => {
                    let before = self.imports.len();
                    self.import(&mut tokens);
                    let new = self.imports.iter().skip(before).filter(|_| was_public);
                    self.reexports.extend(new.map(|(_, path)| path.clone()));
                }
                TokenTree::Ident(word) => {
                    let word = word.to_string();
                    if ITEMS.contains(&word.as_str()) {
                        self.item(&word, &mut tokens);
                    } else {
                        self.path(word, &mut tokens);
                    }
                }
                TokenTree::Group(group) => self.read(group.stream()),
                _ => {}
            }
        }
    }

    fn item(&mut self, keyword: &str, tokens: &mut Tokens) {
        if keyword == "macro_rules" {
            tokens.next();
        }
        let Some(TokenTree::Ident(name)) = tokens.next_if(|token| matches!(token, TokenTree::Ident(_)))
        else {
            return;
        };
        let name = name.to_string();
        let mark = match tokens.peek() {
            Some(TokenTree::Punct(mark)) => mark.as_char(),
            _ => ' ',
        };
        match (keyword, mark) {
            ("mod", ';') => self.modules.push(name),
            // `const fn name` and `*const Name` define no constant.
            ("const", _) if mark != ':' => {
                if name == "fn" {
                    self.item("fn", tokens);
                }
            }
            _ => self.items.push(name),
        }
    }

    /// Reads a path that begins with `first`. A single name is no path.
    fn path(&mut self, first: String, tokens: &mut Tokens) {
        let mut path = vec![first];
        while skip_colons(tokens) {
            match tokens.next_if(|token| matches!(token, TokenTree::Ident(_))) {
                Some(segment) => path.push(segment.to_string()),
                None => break,
            }
        }
        if path.len() > 1 {
            self.paths.push(path);
        }
    }

    fn import(&mut self, tokens: &mut Tokens) {
        let tree: TokenStream = tokens
            .by_ref()
            .take_while(|token| !matches!(token, TokenTree::Punct(mark) if mark.as_char() == ';'))
            .collect();
        self.import_tree(&[], tree);
    }

    /// Reads the branches of a tree of imports: `a::{self, b as c, d::*}`.
    fn import_tree(&mut self, prefix: &[String], tree: TokenStream) {
        let mut path = prefix.to_vec();
        let mut name = None;
        let mut is_prefix = false;
        let mut tokens = tree.into_iter();
        while let Some(token) = tokens.next() {
            match token {
                TokenTree::Ident(word) if word == "as" => name = tokens.next().map(|name| name.to_string()),
                TokenTree::Ident(word) if word == "self" && !path.is_empty() => is_prefix = true,
                TokenTree::Ident(word) => path.push(word.to_string()),
                TokenTree::Punct(mark) if mark.as_char() == '*' => name = Some("*".to_owned()),
                TokenTree::Punct(mark) if mark.as_char() == ',' => {
                    let found = mem::replace(&mut path, prefix.to_vec());
                    if found != prefix || mem::take(&mut is_prefix) || name.is_some() {
                        self.add_import(name.take(), found);
                    }
                }
                TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                    self.import_tree(&mem::replace(&mut path, prefix.to_vec()), group.stream());
                }
                _ => {}
            }
        }
        if path != prefix || is_prefix || name.is_some() {
            self.add_import(name, path);
        }
    }

    fn add_import(&mut self, name: Option<String>, path: Path) {
        let name = name.or_else(|| path.last().cloned());
        self.imports.extend(name.map(|name| (name, path)));
    }
}

/// Skips `::`. Returns whether it was there.
fn skip_colons(tokens: &mut Tokens) -> bool {
    let is_colon = |token: &TokenTree| matches!(token, TokenTree::Punct(mark) if mark.as_char() == ':');
    let is_joint = |token: &TokenTree| matches!(token, TokenTree::Punct(mark) if mark.as_char() == ':' && mark.spacing() == Spacing::Joint);
    tokens.next_if(is_joint).is_some() && tokens.next_if(is_colon).is_some()
}

/// Skips an attribute, and the item behind it if the attribute is `cfg(test)`, or a `path`, which names a file outside the crate.
/// Returns whether there was an attribute.
fn skip_test(tokens: &mut Tokens) -> bool {
    let Some(TokenTree::Group(attribute)) = tokens.next_if(|token| matches!(token, TokenTree::Group(_)))
    else {
        return false;
    };
    let attribute = attribute.stream().to_string().replace(' ', "");
    if attribute == "cfg(test)" || attribute.starts_with("path=") {
        for token in tokens.by_ref() {
            match token {
                TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => break,
                TokenTree::Punct(mark) if mark.as_char() == ';' => break,
                _ => {}
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(text: &str) -> Path {
        text.split("::").map(str::to_owned).collect()
    }

    #[test]
    fn imports_are_parsed() {
        let source =
            SourceFile::parse("use crate::a::{self, b as c, d::{E, F}}; pub use super::g::*; use h;")
                .unwrap();
        let expected = [
            ("a", "crate::a"),
            ("c", "crate::a::b"),
            ("E", "crate::a::d::E"),
            ("F", "crate::a::d::F"),
            ("*", "super::g"),
            ("h", "h"),
        ];
        let found: Vec<_> = expected.iter().map(|(name, from)| ((*name).to_owned(), path(from))).collect();
        for import in &found {
            assert!(source.imports.contains(import), "{import:?} in {:?}", source.imports);
        }
    }

    #[test]
    fn paths_are_found_in_bodies_and_macros_but_not_in_comments_and_tests() {
        let text = "/// [`crate::doc`]\nconst fn f() { a::b(); println!(\"{}\", super::c::D); }\n\
                    #[cfg(test)]\nmod tests { use super::e::F; fn g() { h::i(); } }\n#[inline]\nfn last() {}";
        let source = SourceFile::parse(text).unwrap();
        assert_eq!(source.paths, [path("a::b"), path("super::c::D")]);
        assert_eq!(source.items, ["f", "last"]);
        assert!(source.imports.is_empty());
    }

    #[test]
    fn reexports_are_found() {
        let source =
            SourceFile::parse("pub use a::B; pub(crate) use c::D; use e::F; pub fn g() { use h::I; }")
                .unwrap();
        assert_eq!(source.reexports, [path("a::B"), path("c::D")]);
        assert_eq!(source.imports.len(), 4);
    }

    #[test]
    fn modules_in_files_differ_from_inline_modules() {
        let source =
            SourceFile::parse("mod a; pub(crate) mod b; mod c { fn d() {} } #[cfg(test)] mod e;").unwrap();
        assert_eq!(source.modules, ["a", "b"]);
        assert_eq!(source.items, ["c", "d"]);
    }
}
