//! Stores that lie elsewhere: their addresses, and who fetches them.

use brickfield_engine::Error;
use brickfield_engine::store::{Store, StoreOptions};
use std::path::Path;

/// Whether a name is the address of something on a web server.
pub fn is_address(path: &Path) -> bool {
    let Some((scheme, _)) = path.to_str().and_then(|text| text.split_once("://")) else { return false };
    ["http", "https"].iter().any(|known| scheme.eq_ignore_ascii_case(known))
}

/// Opens the store at an address.
///
/// # Errors
/// As `Store::open_ranges`, and what the server says; that this program fetches nothing.
#[cfg(feature = "http")]
pub fn open(path: &Path, options: StoreOptions) -> Result<Store, Error> {
    let address = path.to_string_lossy();
    let ranges = crate::http::WebFile::open(&address)
        .map_err(|fault| Error::store(path, "request", fault.what, fault.remedy))?;
    Store::open_ranges(path, std::sync::Arc::new(ranges), options)
}

#[cfg(not(feature = "http"))]
pub fn open(path: &Path, _: StoreOptions) -> Result<Store, Error> {
    let remedy = "build it with `--features http`, or copy the store here first";
    Err(Error::store(
        path,
        "request",
        "this program was built without the feature that reads from servers",
        remedy,
    ))
}

/// The error of an address where only files are read.
pub fn not_fetched(path: &Path) -> Error {
    let what = "only stores are read from servers";
    Error::input(path, "address", what, "copy the file here first, and give the copy")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_told_from_files() {
        for (text, expected) in [
            ("http://host/a.brf", true),
            ("HTTPS://host:80/a.brf", true),
            ("http:/host/a.brf", false),
            ("ftp://host/a.brf", false),
            ("a.brf", false),
            ("", false),
        ] {
            assert_eq!(is_address(Path::new(text)), expected, "{text}");
        }
    }
}
