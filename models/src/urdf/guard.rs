//! A scan of raw XML before the parser: it refuses files that could exhaust the parser's stack or
//! time.

use crate::report::{Diagnostics, quoted};
use crate::text::{DEEPEST, Text};

/// Most attributes of one element, and most namespace declarations of a file: the parser's time is
/// quadratic in both.
const MOST_ATTRIBUTES: usize = 256;
const MOST_NAMESPACES: usize = 1024;

/// True when the text may be parsed. Malformed XML passes: the parser reports its position.
pub(super) fn is_harmless(text: &Text, diagnostics: &mut Diagnostics) -> bool {
    let content = text.content.as_str();
    let mut refuse = |at: usize, found: &str, expected: &str, help: &str| {
        diagnostics.error(text.span(at), found, expected, help);
        false
    };
    let mut at = 0;
    let mut depth = 0_usize;
    let mut namespaces = 0;
    while let Some(open) = content.get(at..).and_then(|rest| rest.find('<')).map(|found| at + found)
    {
        let rest = content.get(open..).unwrap_or_default();
        if let Some((start, end)) = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")]
            .into_iter()
            .find(|(start, _)| rest.starts_with(start))
        {
            let Some(close) = rest.get(start.len()..).and_then(|inner| inner.find(end)) else {
                return true;
            };
            at = open + start.len() + close + end.len();
        } else if rest.starts_with("<!") {
            let found = "a document type declaration (DTD)";
            let help = "remove it; the five entities of XML itself need none";
            return refuse(open, found, "a file without one", help);
        } else {
            let tag = Tag::scan(rest);
            if tag.attributes > MOST_ATTRIBUTES || namespaces + tag.namespaces > MOST_NAMESPACES {
                let name = quoted(tag.name);
                let found = format!("the element {name} has too many attributes or namespaces");
                let most = format!("at most {MOST_ATTRIBUTES}");
                return refuse(open, &found, &most, "remove those that no reader knows");
            }
            namespaces += tag.namespaces;
            depth = if tag.closes {
                depth.saturating_sub(1)
            } else {
                depth + usize::from(!tag.is_empty)
            };
            if depth > DEEPEST {
                let most = format!("at most {DEEPEST} levels");
                return refuse(open, "elements are nested too deep", &most, "flatten the file");
            }
            at = open + tag.length;
        }
    }
    true
}

/// The sizes of one tag.
#[derive(Default)]
struct Tag<'a> {
    name: &'a str,
    attributes: usize,
    namespaces: usize,
    closes: bool,
    is_empty: bool,
    length: usize,
}

impl<'a> Tag<'a> {
    /// `rest` begins with `<`; a `>` within quotes does not end the tag.
    fn scan(rest: &'a str) -> Tag<'a> {
        let bytes = rest.as_bytes();
        let mut tag =
            Tag { closes: bytes.get(1) == Some(&b'/'), length: bytes.len(), ..Tag::default() };
        let name_end =
            rest.find(|c: char| c.is_ascii_whitespace() || c == '>').unwrap_or(rest.len());
        tag.name = rest.get(1..name_end).unwrap_or_default().trim_matches('/');
        let mut quote = None;
        for (i, byte) in bytes.iter().copied().enumerate().skip(1) {
            match quote {
                Some(open) if byte == open => quote = None,
                Some(_) => {}
                None if byte == b'"' || byte == b'\'' => {
                    quote = Some(byte);
                    tag.attributes += 1;
                }
                None if byte == b'>' => {
                    tag.is_empty = bytes.get(i - 1) == Some(&b'/');
                    tag.length = i + 1;
                    break;
                }
                None => {
                    tag.namespaces +=
                        usize::from(byte == b'x' && bytes.get(i..i + 5) == Some(b"xmlns"))
                }
            }
        }
        tag
    }
}
