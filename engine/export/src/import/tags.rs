//! The tags of an XML file whose content is passed over, however long it is, and may be no text.

/// A tag: its name, with `/` in front where it ends an element, and what stands behind that.
pub(super) struct Tag<'a> {
    pub name: &'a str,
    /// The byte behind it.
    pub end: usize,
    attributes: &'a str,
}

impl<'a> Tag<'a> {
    /// The value of an attribute.
    pub fn value(&self, wanted: &str) -> Option<&'a str> {
        let mut rest = self.attributes;
        loop {
            let (name, after) = rest.split_once('=')?;
            let quote = after.trim_start().chars().next().filter(|c| "\"'".contains(*c))?;
            let (value, behind) = after.trim_start()[1..].split_once(quote)?;
            if name.trim() == wanted {
                return Some(value);
            }
            rest = behind;
        }
    }
}

/// All tags but comments and instructions; of one that is none the byte where it stands.
pub(super) fn tags(bytes: &[u8]) -> impl Iterator<Item = Result<Tag<'_>, usize>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        loop {
            let start = at + bytes[at..].iter().position(|&b| b == b'<')? + 1;
            let rest = &bytes[start..];
            at = bytes.len();
            if rest.starts_with(b"!--") {
                at = start + rest.windows(3).position(|end| end == b"-->")?;
                continue;
            }
            let length = rest.iter().position(|&b| b == b'>');
            let text = length.and_then(|length| std::str::from_utf8(&rest[..length]).ok());
            let Some(text) = text else { return Some(Err(start - 1)) };
            at = start + text.len() + 1;
            if text.starts_with(['?', '!']) {
                continue;
            }
            let end = text.find(|c: char| c.is_ascii_whitespace()).unwrap_or(text.len());
            let name = if end == text.len() { text.trim_end_matches('/') } else { &text[..end] };
            return Some(Ok(Tag { name, end: at, attributes: &text[end..] }));
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_have_names_and_values() {
        let text = b"<?xml version='1.0'?><!-- <no> --><a b = \"1\" c='<2'/>\xff\xfe<d/></a ><e";
        let found: Vec<_> = tags(text).collect();
        let names: Vec<_> =
            found.iter().map(|tag| tag.as_ref().map(|tag| tag.name).map_err(|at| *at)).collect();
        assert_eq!(names, [Ok("a"), Ok("d"), Ok("/a"), Err(text.len() - 2)]);
        let first = found[0].as_ref().unwrap();
        assert_eq!((first.value("b"), first.value("c"), first.value("d")), (Some("1"), Some("<2"), None));
        assert!(text[first.end..].starts_with(b"\xff\xfe<d/>"));
    }
}
