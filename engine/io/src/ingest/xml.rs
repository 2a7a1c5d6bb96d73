//! Attributes of XML elements.

use quick_xml::events::BytesStart;

/// The value of an element's attribute, whatever its namespace.
pub(super) fn attribute(tag: &BytesStart<'_>, wanted: &str) -> Option<String> {
    let mut all = tag.attributes().flatten();
    all.find(|a| a.key.local_name().as_ref() == wanted).map(|found| found.value.into_owned())
}
