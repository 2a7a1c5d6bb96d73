//! NumPy's array files.

/// NumPy asks for a header of a multiple of this.
const HEADER_ALIGN_BYTES: usize = 64;
/// Magic, version and length before the header's text.
const HEADER_PREFIX_BYTES: usize = 10;

/// The header of an `.npy` file, version 1.0, of a cube of `axis` elements an axis.
pub fn npy_header(dtype: &str, axis: usize) -> Vec<u8> {
    let mut text =
        format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({axis}, {axis}, {axis}), }}");
    let bytes = (HEADER_PREFIX_BYTES + text.len() + 1).next_multiple_of(HEADER_ALIGN_BYTES);
    while HEADER_PREFIX_BYTES + text.len() + 1 < bytes {
        text.push(' ');
    }
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend((text.len() as u16).to_le_bytes());
    header.extend(text.bytes());
    header
}
