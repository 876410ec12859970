//! Where in a scene file's text a field stands: from a place to a path such as `media[0].phase.g`, and back.
//!
//! RON's errors carry a line and a column but no path, and the parsed scene carries neither; walking the brackets of the text
//! gives both, and works on text that does not parse.

/// A piece of text that is neither space nor comment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Token<'a> {
    /// Byte offset in the source.
    pub(super) start: usize,
    pub(super) text: &'a str,
}

impl Token<'_> {
    fn end(&self) -> usize {
        self.start + self.text.len()
    }

    fn is_word(&self) -> bool {
        self.text.starts_with(is_word_char)
    }
}

fn is_word_char(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '.' | '+' | '-')
}

/// The tokens of `source`: words and numbers, strings, and single characters.
fn tokens(source: &str) -> impl Iterator<Item = Token<'_>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        loop {
            let rest = &source[at..];
            let first = rest.chars().next()?;
            let (length, is_token) = if first.is_whitespace() {
                (first.len_utf8(), false)
            } else if rest.starts_with("//") {
                (rest.find('\n').unwrap_or(rest.len()), false)
            } else if rest.starts_with("/*") {
                (block_comment_length(rest), false)
            } else if let Some(length) = string_length(rest) {
                (length, true)
            } else if is_word_char(first) {
                let end = rest.find(|c| !is_word_char(c));
                (end.unwrap_or(rest.len()), true)
            } else {
                (first.len_utf8(), true)
            };
            let start = at;
            at += length;
            if is_token {
                let text = &source[start..at];
                return Some(Token { start, text });
            }
        }
    })
}

/// Length of the block comment at the start of `text`; comments nest.
fn block_comment_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let (mut at, mut depth) = (0, 0);
    while at + 1 < bytes.len() {
        match &bytes[at..at + 2] {
            b"/*" => depth += 1,
            b"*/" => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return at;
        }
    }
    text.len()
}

/// Length of the plain or raw string at the start of `text`, up to the end of the text where it is not closed.
fn string_length(text: &str) -> Option<usize> {
    let raw = text.strip_prefix('r').map(|rest| {
        let hashes = rest.len() - rest.trim_start_matches('#').len();
        (hashes, &rest[hashes..])
    });
    if let Some((hashes, rest)) = raw
        && let Some(content) = rest.strip_prefix('"')
    {
        let close = format!("\"{}", "#".repeat(hashes));
        let opening = text.len() - content.len();
        let end = content.find(&close).map(|i| opening + i + close.len());
        return Some(end.unwrap_or(text.len()));
    }
    let content = text.strip_prefix('"')?;
    let mut escaped = false;
    for (i, c) in content.char_indices() {
        match c {
            '"' if !escaped => return Some(i + 2),
            '\\' => escaped = !escaped,
            _ => escaped = false,
        }
    }
    Some(text.len())
}

/// An open bracket.
#[derive(Clone, Copy, Debug)]
struct Frame<'a> {
    /// Where the value starts: at the bracket, or at the name before it.
    start: usize,
    bracket: char,
    has_name: bool,
    has_fields: bool,
    /// The field being written.
    field: Option<&'a str>,
    /// The entry being written.
    index: usize,
}

/// The brackets open at some place.
#[derive(Debug, Default)]
struct Walk<'a> {
    frames: Vec<Frame<'a>>,
    last: Option<Token<'a>>,
}

impl<'a> Walk<'a> {
    /// Steps past a token.
    fn step(&mut self, token: Token<'a>) {
        match token.text {
            "(" | "[" | "{" => {
                let name = self.last.filter(Token::is_word);
                self.frames.push(Frame {
                    start: name.map_or(token.start, |name| name.start),
                    bracket: if token.text == "(" { '(' } else { '[' },
                    has_name: name.is_some(),
                    has_fields: false,
                    field: None,
                    index: 0,
                });
            }
            ")" | "]" | "}" => {
                self.frames.pop();
            }
            "," => {
                if let Some(frame) = self.frames.last_mut() {
                    frame.index += 1;
                    frame.field = None;
                }
            }
            ":" => {
                if let (Some(frame), Some(field)) = (self.frames.last_mut(), self.last) {
                    frame.has_fields = true;
                    frame.field = Some(field.text);
                }
            }
            _ => {}
        }
        self.last = Some(token);
    }

    /// The path of the value being written, as in `media[0].albedo[1]`; empty for the scene itself.
    fn path(&self) -> String {
        let mut path = String::new();
        for (depth, frame) in self.frames.iter().enumerate() {
            let is_variant = frame.bracket == '(' && frame.has_name && frame.index == 0;
            if let Some(field) = frame.field {
                if !path.is_empty() {
                    path.push('.');
                }
                path.push_str(field);
            } else if depth > 0 && !frame.has_fields && !is_variant {
                path.push_str(&format!("[{}]", frame.index));
            }
        }
        path
    }
}

/// What stands at a place.
#[derive(Debug, PartialEq)]
pub(super) struct Found<'a> {
    /// Path of the value that holds the place, as in `media[0].phase.g`; empty for the scene itself.
    pub(super) path: String,
    /// Byte offset at which that value starts.
    pub(super) start: usize,
    /// The token there; `None` at the end of the text.
    pub(super) token: Option<Token<'a>>,
    /// The token before it.
    pub(super) before: Option<Token<'a>>,
}

/// The value at byte `offset` of `source`. A closing bracket stands for the whole value that it closes.
pub(super) fn at<'a>(source: &'a str, offset: usize) -> Found<'a> {
    let mut walk = Walk::default();
    let mut rest = tokens(source).peekable();
    while let Some(token) = rest.next_if(|token| token.end() <= offset) {
        walk.step(token);
    }
    let token = rest.next();
    let mut start = token.map_or(source.len(), |token| token.start);
    match token.map(|token| token.text) {
        Some(")" | "]" | "}") => {
            start = walk.frames.pop().map_or(start, |frame| frame.start);
        }
        // A name before a colon belongs to the struct around it, even if it is the first.
        Some(_) if rest.next().is_some_and(|next| next.text == ":") => {
            if let Some(frame) = walk.frames.last_mut() {
                frame.has_fields = true;
            }
        }
        _ => {}
    }
    Found {
        path: walk.path(),
        start,
        token,
        before: walk.last,
    }
}

/// Line and column, both from 1 and the column in characters, of the value with this path; of the scene where there is none.
pub(crate) fn place_of(source: &str, path: &str) -> (usize, usize) {
    let mut walk = Walk::default();
    let mut rest = tokens(source).peekable();
    while let Some(token) = rest.next() {
        let is_value = !matches!(token.text, "," | ":" | ")" | "]" | "}");
        let is_field = rest.peek().is_some_and(|next| next.text == ":");
        if is_value && !is_field && walk.path() == path {
            return line_and_column(source, token.start);
        }
        walk.step(token);
    }
    (1, 1)
}

/// Line and column of a byte offset, both from 1, the column in characters.
pub(super) fn line_and_column(source: &str, offset: usize) -> (usize, usize) {
    let before = &source[..offset];
    let line_start = before.rfind('\n').map_or(0, |i| i + 1);
    let line = before.matches('\n').count() + 1;
    (line, before[line_start..].chars().count() + 1)
}

/// Byte offset of a line and column as [`line_and_column`] counts them, at most the length of the text.
pub(super) fn offset_of(source: &str, line: usize, column: usize) -> usize {
    let start: usize = source
        .split_inclusive('\n')
        .take(line.saturating_sub(1))
        .map(str::len)
        .sum();
    let in_line = source[start..].char_indices().nth(column.saturating_sub(1));
    in_line.map_or(source.len(), |(i, _)| start + i)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    const SOURCE: &str = r##"// a comment with ( and "
Scene(
    gltf: "a (b).glb", /* another [ /* nested */ */
    media: [
        Medium(albedo: (0.9, 0.8, 0.7), region: Everywhere),
        (phase: Mixture([(0.5, Isotropic), (0.5, HenyeyGreenstein(g: 2.0))]),
         density: Constant(3.5), name: r#"quoted " name"#),
    ],
)"##;

    #[test]
    fn every_place_has_the_path_of_its_field() {
        for (text, path) in [
            ("Scene", ""),
            ("gltf", ""),
            ("\"a (b)", "gltf"),
            ("media", ""),
            ("Medium", "media[0]"),
            ("albedo", "media[0]"),
            ("0.8", "media[0].albedo[1]"),
            ("Everywhere", "media[0].region"),
            ("phase", "media[1]"),
            ("Mixture", "media[1].phase"),
            ("HenyeyGreenstein", "media[1].phase[1][1]"),
            ("2.0", "media[1].phase[1][1].g"),
            ("3.5", "media[1].density"),
            ("r#", "media[1].name"),
        ] {
            let offset = SOURCE.find(text).unwrap();
            assert_eq!(at(SOURCE, offset).path, path, "{text}");
        }
    }

    #[test]
    fn a_closing_bracket_stands_for_the_value_it_closes() {
        let offset = SOURCE.find("), region").unwrap();
        let found = at(SOURCE, offset);
        assert_eq!(found.path, "media[0].albedo");
        assert!(SOURCE[found.start..].starts_with("(0.9"));
    }

    #[test]
    fn a_path_leads_back_to_its_place() {
        for (path, text) in [
            ("", "Scene"),
            ("gltf", "\"a (b)"),
            ("media", "[\n"),
            ("media[0]", "Medium"),
            ("media[1]", "(phase"),
            ("media[1].phase", "Mixture"),
            ("media[1].phase[1][1].g", "2.0"),
        ] {
            let expected = line_and_column(SOURCE, SOURCE.find(text).unwrap());
            assert_eq!(place_of(SOURCE, path), expected, "{path}");
        }
        assert_eq!(place_of(SOURCE, "no.such"), (1, 1));
    }

    #[test]
    fn columns_count_characters_and_lines_count_line_feeds() {
        let source = "ab\r\nçdé\n\nx";
        for (text, place) in [("a", (1, 1)), ("é", (2, 3)), ("x", (4, 1))] {
            let offset = source.find(text).unwrap();
            assert_eq!(line_and_column(source, offset), place, "{text}");
            assert_eq!(offset_of(source, place.0, place.1), offset, "{text}");
        }
        assert_eq!(offset_of(source, 9, 9), source.len());
    }

    #[test]
    fn text_that_does_not_parse_has_places_too() {
        for source in [
            "",
            ")",
            "((((",
            "\"open",
            "r##\"open\"#",
            "/* open",
            ":,:",
            "é(",
            "/",
            "\\",
        ] {
            for offset in (0..=source.len()).filter(|&i| source.is_char_boundary(i)) {
                at(source, offset);
            }
        }
    }
}
