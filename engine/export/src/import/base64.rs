//! Base64 of RFC 4648, read as a stream. Padding may stand between parts that were coded each on its own.

use std::io::{Error, ErrorKind, Read, Result};

/// Decodes text; blanks and line ends are passed over.
pub(super) struct Base64<'a> {
    text: &'a [u8],
    /// Bytes of the last four letters that were not asked for yet.
    left: [u8; 3],
    range: (usize, usize),
}

impl<'a> Base64<'a> {
    /// Of letters.
    pub fn new(text: &'a [u8]) -> Base64<'a> {
        Base64 { text, left: [0; 3], range: (0, 0) }
    }

    /// Decodes four letters; false at the end.
    fn step(&mut self) -> Result<bool> {
        let (mut bits, mut letters, mut padding) = (0u32, 0, 0);
        while letters < 4 {
            let Some((&letter, rest)) = self.text.split_first() else { break };
            self.text = rest;
            let value = match letter {
                b'A'..=b'Z' => letter - b'A',
                b'a'..=b'z' => letter - b'a' + 26,
                b'0'..=b'9' => letter - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' => {
                    padding += 1;
                    0
                }
                _ if letter.is_ascii_whitespace() => continue,
                _ => return Err(Error::new(ErrorKind::InvalidData, "a letter is none of base64")),
            };
            if padding > 0 && letter != b'=' {
                return Err(Error::new(ErrorKind::InvalidData, "base64 goes on within its padding"));
            }
            bits = bits << 6 | u32::from(value);
            letters += 1;
        }
        if letters == 0 {
            return Ok(false);
        }
        if letters < 4 || padding > 2 {
            return Err(Error::new(ErrorKind::InvalidData, "base64 ends within four letters"));
        }
        let [_, bytes @ ..] = bits.to_be_bytes();
        (self.left, self.range) = (bytes, (0, 3 - padding));
        Ok(true)
    }
}

impl Read for Base64<'_> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let mut written = 0;
        while written < out.len() {
            if self.range.0 == self.range.1 && !self.step()? {
                break;
            }
            out[written] = self.left[self.range.0];
            self.range.0 += 1;
            written += 1;
        }
        Ok(written)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(text: &str) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        Base64::new(text.as_bytes()).read_to_end(&mut bytes).map(|_| bytes)
    }

    #[test]
    fn decodes_the_vectors_of_the_standard() {
        for (text, bytes) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYmFy", "foobar")]
        {
            assert_eq!(decoded(text).unwrap(), bytes.as_bytes());
        }
        assert_eq!(decoded(" Zg==\n Zm8=Zm9v ").unwrap(), b"ffofoo");
        assert_eq!(decoded("//79").unwrap(), [255, 254, 253]);
        for bad in ["Z", "Zg=", "Zg=a", "Z===", "Zm9*"] {
            assert!(decoded(bad).is_err(), "{bad}");
        }
    }
}
