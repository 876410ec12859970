//! What is wrong with a scene file, where, and how to say it.

use super::forms::{form_of, nearest};
use super::outline::{self, Found, Token};
use ron::error::{Error as RonError, SpannedError};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::Utf8Error;

/// A place in a scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The scene file.
    pub path: PathBuf,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { path, line, column } = self;
        write!(
            f,
            "line {line}, column {column}, {}:{line}:{column}",
            path.display()
        )
    }
}

/// A scene file's first fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneFileError {
    /// What is wrong.
    pub fault: Fault,
    /// Path of the field, as in `media[0].phase.g`; empty for the scene itself.
    pub field: String,
    /// Where the field or the unexpected text stands.
    pub place: Place,
}

impl std::error::Error for SceneFileError {}

impl fmt::Display for SceneFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.fault)?;
        if self.field.is_empty() {
            write!(f, " ({})", self.place)
        } else {
            write!(f, " (at `{}`, {})", self.field, self.place)
        }
    }
}

/// Ways in which a scene file can be wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A name that is no field, or no variant, of the thing it stands in.
    UnknownName {
        /// What the name should be, as in "a field of Medium".
        kind: String,
        /// The name written.
        found: String,
        /// Names that could stand here.
        allowed: Vec<&'static str>,
    },
    /// A field that has no default was left out.
    MissingField {
        /// The field.
        field: &'static str,
        /// What it belongs to.
        owner: String,
    },
    /// A field was written twice.
    DuplicateField {
        /// The field.
        field: &'static str,
    },
    /// A value of another type than the field's.
    WrongType {
        /// The text found.
        found: String,
        /// How the field is written.
        allowed: String,
    },
    /// A value that the field cannot have.
    OutOfRange {
        /// The number found, where it is a single one.
        found: Option<String>,
        /// What is allowed.
        rule: String,
    },
    /// Text that breaks the grammar of RON.
    Syntax {
        /// What the grammar wants.
        wanted: String,
        /// The text found.
        found: String,
    },
    /// Brackets within brackets beyond any sense.
    TooDeep,
    /// Bytes that are not text.
    NotUtf8 {
        /// What the bytes look like instead.
        hint: &'static str,
    },
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Fault::UnknownName {
                kind,
                found,
                allowed,
            } => {
                write!(f, "`{found}` is not {kind}")?;
                if let Some(name) = nearest(found, allowed) {
                    write!(f, " (did you mean `{name}`?)")?;
                }
                write!(f, "; allowed: `{}`", allowed.join("`, `"))
            }
            Fault::MissingField { field, owner } => {
                write!(f, "{owner} lacks the field `{field}`")?;
                match form_of(field) {
                    Some(form) => write!(f, "; add it: {form}"),
                    None => Ok(()),
                }
            }
            Fault::DuplicateField { field } => {
                write!(
                    f,
                    "the field `{field}` is written twice; remove one of the two"
                )
            }
            Fault::WrongType { found, allowed } => write!(f, "found {found}; write {allowed}"),
            Fault::OutOfRange {
                found: Some(found),
                rule,
            } => write!(f, "found {found}, but {rule}"),
            Fault::OutOfRange { found: None, rule } => write!(f, "{rule}"),
            Fault::Syntax { wanted, found } => write!(f, "found {found} where {wanted}"),
            Fault::TooDeep => write!(
                f,
                "brackets are nested more than a hundred deep; a scene needs no more than ten"
            ),
            Fault::NotUtf8 { hint } => write!(f, "the file is not UTF-8 text; {hint}"),
        }
    }
}

impl SceneFileError {
    /// The fault that RON found in `text`.
    pub(super) fn new(error: SpannedError, text: &str, path: &Path) -> Self {
        let position = match error.code {
            // These want something behind the last thing read.
            RonError::ExpectedComma | RonError::Eof => error.span.end,
            _ => error.span.start,
        };
        let offset = outline::offset_of(text, position.line, position.col);
        let mut found = outline::at(text, offset);
        // A variant that lacks its parentheses is noticed only behind it.
        let lacks_more = matches!(error.code, RonError::ExpectedStructLike);
        if lacks_more
            && let (Some(token), Some(before)) = (found.token, found.before)
            && matches!(token.text, ")" | "]" | "}" | ",")
        {
            found = outline::at(text, before.start);
        }
        let fault = fault(error.code, &found);
        let (line, column) = outline::line_and_column(text, found.start);
        Self {
            fault,
            field: found.path,
            place: Place {
                path: path.into(),
                line,
                column,
            },
        }
    }

    /// A file whose bytes stop being text at `error`.
    pub(super) fn not_utf8(bytes: &[u8], error: Utf8Error, path: &Path) -> Self {
        let hint = match bytes {
            [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "it looks like UTF-16: save it as UTF-8",
            _ => "save it as UTF-8, or check that it is a scene file",
        };
        let text = String::from_utf8_lossy(bytes.get(..error.valid_up_to()).unwrap_or_default());
        let (line, column) = outline::line_and_column(&text, text.len());
        Self {
            fault: Fault::NotUtf8 { hint },
            field: String::new(),
            place: Place {
                path: path.into(),
                line,
                column,
            },
        }
    }
}

/// RON's error in the words of a scene file.
fn fault(code: RonError, found: &Found<'_>) -> Fault {
    let text = described(found.token);
    let syntax = |wanted: &str| Fault::Syntax {
        wanted: wanted.into(),
        found: text.clone(),
    };
    let field = found.path.rsplit('.').next().unwrap_or_default();
    let field = field.split('[').next().unwrap_or_default();
    let wrong_type = |fallback: &str| Fault::WrongType {
        found: text.clone(),
        allowed: form_of(field).unwrap_or(fallback).into(),
    };
    match code {
        RonError::NoSuchStructField {
            expected,
            found,
            outer,
        } => Fault::UnknownName {
            kind: format!("a field of {}", outer.as_deref().unwrap_or("Scene")),
            found,
            allowed: expected.to_vec(),
        },
        RonError::NoSuchEnumVariant {
            expected,
            found,
            outer,
        } => Fault::UnknownName {
            kind: outer.map_or("known here".into(), |outer| format!("a {outer}")),
            found,
            allowed: expected.to_vec(),
        },
        RonError::ExpectedDifferentStructName { expected, found } => Fault::UnknownName {
            kind: "the name that belongs here".into(),
            found,
            allowed: vec![expected],
        },
        RonError::MissingStructField { field, outer } => Fault::MissingField {
            field,
            owner: outer.unwrap_or("the scene".into()),
        },
        RonError::DuplicateStructField { field, .. } => Fault::DuplicateField { field },
        RonError::Message(rule) => Fault::OutOfRange {
            found: found
                .token
                .filter(|token| !matches!(token.text, ")" | "]" | "}"))
                .map(|token| described(Some(token))),
            rule,
        },
        RonError::ExpectedDifferentLength { found, .. } => Fault::WrongType {
            found: format!("{found} values"),
            allowed: form_of(field).unwrap_or("another number of values").into(),
        },
        RonError::ExpectedNamedStructLike("Scene") => syntax("Scene(…) must begin"),
        RonError::ExpectedFloat | RonError::ExpectedInteger => wrong_type("a number"),
        RonError::ExpectedString => wrong_type("text in double quotes"),
        RonError::ExpectedArray => wrong_type("a list in square brackets"),
        RonError::ExpectedStructLike
        | RonError::ExpectedNamedStructLike(_)
        | RonError::ExpectedStructLikeEnd
        | RonError::ExpectedOption
        | RonError::ExpectedOptionEnd
        | RonError::ExpectedUnit
        | RonError::InvalidValueForType { .. } => wrong_type("a value in parentheses"),
        RonError::ExpectedIdentifier
        | RonError::InvalidIdentifier(_)
        | RonError::SuggestRawIdentifier(_) => {
            syntax("the name of a field must stand, as in `name: value`")
        }
        RonError::ExpectedComma => syntax("a comma or a closing bracket must stand"),
        RonError::ExpectedMapColon => syntax("a colon must follow the field's name"),
        RonError::ExpectedArrayEnd => syntax("`]` must close the list"),
        RonError::ExpectedStringEnd => syntax("text must end with a double quote"),
        RonError::UnclosedBlockComment => syntax("`*/` must close a comment"),
        RonError::TrailingCharacters => {
            syntax("the file must end, after the scene's closing bracket")
        }
        RonError::Eof => syntax("more must follow"),
        RonError::ExceededRecursionLimit => Fault::TooDeep,
        other => Fault::Syntax {
            wanted: format!("RON cannot read on: {other}"),
            found: text,
        },
    }
}

/// A token for a message, shortened if it is long.
fn described(token: Option<Token<'_>>) -> String {
    const LONGEST: usize = 40;
    let Some(token) = token else {
        return "the end of the file".into();
    };
    let (shown, cut) = match token.text.char_indices().nth(LONGEST) {
        Some((end, _)) => (&token.text[..end], "…"),
        None => (token.text, ""),
    };
    let mut described = String::from("`");
    for c in shown.chars() {
        match c {
            // A line break or an escape sequence must not reach the terminal.
            c if c.is_control() => described.extend(c.escape_default()),
            c => described.push(c),
        }
    }
    described + cut + "`"
}
