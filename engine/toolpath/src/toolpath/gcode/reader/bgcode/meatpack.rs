//! MeatPack: characters of G-code in four bits each.

/// A byte that is given twice before a command.
const SIGNAL: u8 = 0xff;
/// Stands for a character that follows whole.
const WHOLE: u8 = 15;
const CHARACTERS: &[u8; 15] = b"0123456789. \nGX";
/// Stands for a blank, or without blanks for E.
const BLANK: u8 = 11;

/// The state of a decoder, which lasts from block to block.
#[derive(Default)]
pub(super) struct MeatPack {
    is_packed: bool,
    leaves_out_blanks: bool,
    signals: u8,
    /// Whether the last character ended a line.
    ended_line: bool,
    /// Characters of a pair that follow whole, and one of it that comes after them.
    whole: u8,
    after: Option<u8>,
}

impl MeatPack {
    /// Unpacks a block.
    pub(super) fn unpack(&mut self, packed: &[u8], out: &mut Vec<u8>) {
        let start = out.len();
        let mut plain = Vec::new();
        for &byte in packed {
            self.take(byte, &mut plain);
            self.ended_line = plain.last().map_or(self.ended_line, |&last| last == b'\n');
        }
        if self.leaves_out_blanks { put_blanks(&plain, out, start) } else { out.extend(plain) }
    }

    fn take(&mut self, byte: u8, out: &mut Vec<u8>) {
        if self.signals == 2 {
            self.signals = 0;
            self.command(byte);
            return;
        }
        if byte == SIGNAL {
            self.signals += 1;
            return;
        }
        if self.signals == 1 {
            // A pair of characters that both follow whole.
            self.signals = 0;
            self.data(SIGNAL, out);
        }
        self.data(byte, out);
    }

    fn command(&mut self, command: u8) {
        match command {
            0xfb => self.is_packed = true,
            0xfa => self.is_packed = false,
            0xf9 => *self = MeatPack::default(),
            0xf7 => self.leaves_out_blanks = true,
            0xf6 => self.leaves_out_blanks = false,
            _ => {}
        }
    }

    fn data(&mut self, byte: u8, out: &mut Vec<u8>) {
        if !self.is_packed {
            out.push(byte);
        } else if self.whole > 0 {
            self.whole -= 1;
            out.push(byte);
            if self.whole == 0 {
                out.extend(self.after.take());
            }
        } else {
            self.pair(byte & 15, byte >> 4, out);
        }
    }

    fn pair(&mut self, low: u8, high: u8, out: &mut Vec<u8>) {
        let (first, second) = (self.character(low), self.character(high));
        match (first, second) {
            // Lines of an even number of characters are filled up with one more end.
            (Some(b'\n'), _) if self.ended_line => {}
            (Some(b'\n'), _) => out.push(b'\n'),
            (Some(first), Some(second)) => out.extend([first, second]),
            (Some(first), None) => {
                out.push(first);
                self.whole = 1;
            }
            (None, second) => {
                self.whole = if second.is_none() { 2 } else { 1 };
                self.after = second;
            }
        }
    }

    /// The character of four bits; none of one that follows whole.
    fn character(&self, bits: u8) -> Option<u8> {
        match bits {
            WHOLE => None,
            BLANK if self.leaves_out_blanks => Some(b'E'),
            _ => Some(CHARACTERS[usize::from(bits)]),
        }
    }
}

/// Appends lines whose words have no blanks between them. Words of a comment have theirs.
fn put_blanks(plain: &[u8], out: &mut Vec<u8>, start: usize) {
    let mut in_command = true;
    for &byte in plain {
        match byte {
            b'\n' => in_command = true,
            b';' => in_command = false,
            b'A'..=b'Z' | b'a'..=b'z' if in_command && out.len() > start && out.last() != Some(&b'\n') => {
                out.push(b' ')
            }
            _ => {}
        }
        out.push(byte);
    }
}
