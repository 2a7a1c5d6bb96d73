//! Binary G-code (`.bgcode`, version 1): blocks of text, each compressed and encoded in a way of its own.
//!
//! ```text
//! "GCDE"  u32 version  u16 checksum (0 none, 1 CRC-32)
//! block:  u16 kind  u16 compression  u32 bytes  [u32 packed bytes, if compressed]
//!         parameters (6 bytes of a thumbnail, else 2: encoding)  data  [u32 CRC-32 over all of it]
//! ```
//! What comes out is the text of the G-code blocks, and behind it the settings of the other blocks as comments, as slicers
//! write them at the end of a text. So lines are numbered as in the text of the G-code alone.

mod heatshrink;
mod meatpack;

use meatpack::MeatPack;
use std::io::{self, Read};

/// How a file begins.
pub(super) const MAGIC: &[u8] = b"GCDE";
/// Settings that are kept at most; the largest have some hundred kilobytes.
const SETTINGS_BYTES_MAX: usize = 1 << 24;
/// What a block may unpack to. Slicers make blocks of 64 KiB.
const BLOCK_BYTES_MAX: usize = 1 << 28;

const GCODE: u16 = 1;
const THUMBNAIL: u16 = 5;

/// The text in a file.
pub(super) struct Bgcode<R> {
    packed: R,
    has_checksums: bool,
    /// Number of the block that is read, from 1; 0 before the header.
    block: u64,
    text: Vec<u8>,
    at: usize,
    settings: Vec<u8>,
    is_done: bool,
    meatpack: MeatPack,
}

impl<R: Read> Bgcode<R> {
    /// Of a file, from its first byte.
    pub(super) fn new(packed: R) -> Bgcode<R> {
        Bgcode {
            packed,
            has_checksums: false,
            block: 0,
            text: Vec::new(),
            at: 0,
            settings: Vec::new(),
            is_done: false,
            meatpack: MeatPack::default(),
        }
    }

    fn header(&mut self) -> io::Result<()> {
        let mut header = [0; 10];
        self.packed.read_exact(&mut header)?;
        let (version, checksum) = (word(&header[4..]), half(&header[8..]));
        if version != 1 || checksum > 1 {
            return Err(self.damaged(&format!("version {version} with checksum {checksum} is not known")));
        }
        self.has_checksums = checksum == 1;
        Ok(())
    }

    /// Reads the next block into the text or the settings. False at the end of the file.
    fn next_block(&mut self) -> io::Result<bool> {
        self.block += 1;
        let mut head = vec![0; 8];
        match self.packed.read(&mut head[..1])? {
            0 => return Ok(false),
            _ => self.packed.read_exact(&mut head[1..])?,
        }
        let (kind, compression, bytes) = (half(&head), half(&head[2..]), word(&head[4..]) as usize);
        let mut packed_bytes = bytes;
        if compression != 0 {
            packed_bytes = word(&self.more(&mut head, 4)?) as usize;
        }
        let parameters = self.more(&mut head, if kind == THUMBNAIL { 6 } else { 2 })?;
        let mut data = Vec::new();
        self.packed.by_ref().take(packed_bytes as u64).read_to_end(&mut data)?;
        if data.len() < packed_bytes {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        if self.has_checksums {
            let mut told = [0; 4];
            self.packed.read_exact(&mut told)?;
            if crc32(&[&head, &data]) != u32::from_le_bytes(told) {
                return Err(self.damaged("does not fit its checksum"));
            }
        }
        if kind == THUMBNAIL {
            return Ok(true);
        }
        let data = self.unpack(data, compression, bytes)?;
        match kind {
            GCODE => match half(&parameters) {
                0 => self.text.extend(data),
                1 | 2 => self.meatpack.unpack(&data, &mut self.text),
                other => return Err(self.damaged(&format!("encoding {other} is not known"))),
            },
            0 | 2 | 3 | 4 => self.settings(&data),
            _ => {}
        }
        Ok(true)
    }

    /// Reads more of the block's head.
    fn more(&mut self, head: &mut Vec<u8>, bytes: usize) -> io::Result<Vec<u8>> {
        let start = head.len();
        head.resize(start + bytes, 0);
        self.packed.read_exact(&mut head[start..])?;
        Ok(head[start..].to_vec())
    }

    fn unpack(&self, data: Vec<u8>, compression: u16, bytes: usize) -> io::Result<Vec<u8>> {
        if bytes > BLOCK_BYTES_MAX {
            return Err(self.damaged(&format!("claims {bytes} bytes")));
        }
        let mut out = Vec::new();
        match compression {
            0 => out = data,
            1 => {
                flate2::read::ZlibDecoder::new(&data[..]).take(bytes as u64 + 1).read_to_end(&mut out)?;
            }
            2 => heatshrink::unpack(&data, (11, 4), bytes, &mut out),
            3 => heatshrink::unpack(&data, (12, 4), bytes, &mut out),
            other => return Err(self.damaged(&format!("compression {other} is not known"))),
        }
        if out.len() != bytes {
            return Err(self.damaged(&format!("unpacks to {} bytes, not {bytes}", out.len())));
        }
        Ok(out)
    }

    /// Keeps lines `key=value` as comments.
    fn settings(&mut self, data: &[u8]) {
        for line in data.split(|&b| b == b'\n') {
            let line = line.trim_ascii();
            let Some(equals) = line.iter().position(|&b| b == b'=') else { continue };
            if self.settings.len() + line.len() > SETTINGS_BYTES_MAX {
                return;
            }
            let (key, value) = (line[..equals].trim_ascii(), line[equals + 1..].trim_ascii());
            // As a text's first line has it.
            if key == b"Producer" {
                self.settings.extend([b"; generated by ", value, b"\n"].concat());
            }
            self.settings.extend([b"; ", key, b" = ", value, b"\n"].concat());
        }
    }

    fn damaged(&self, what: &str) -> io::Error {
        let place = if self.block == 0 { "header".to_owned() } else { format!("block {}", self.block) };
        io::Error::new(io::ErrorKind::InvalidData, format!("{place} of the binary G-code: {what}"))
    }
}

impl<R: Read> Read for Bgcode<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.at == self.text.len() {
            if self.is_done {
                return Ok(0);
            }
            self.text.clear();
            self.at = 0;
            if self.block == 0 {
                self.header()?;
            }
            if !self.next_block()? {
                self.is_done = true;
                if !self.settings.is_empty() {
                    self.text.push(b'\n');
                    self.text.append(&mut self.settings);
                }
            }
        }
        let count = buffer.len().min(self.text.len() - self.at);
        buffer[..count].copy_from_slice(&self.text[self.at..self.at + count]);
        self.at += count;
        Ok(count)
    }
}

fn half(bytes: &[u8]) -> u16 {
    u16::from_le_bytes([bytes[0], bytes[1]])
}

fn word(bytes: &[u8]) -> u32 {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

fn crc32(parts: &[&[u8]]) -> u32 {
    let mut crc = flate2::Crc::new();
    parts.iter().for_each(|part| crc.update(part));
    crc.sum()
}

#[cfg(test)]
mod tests;
