//! Screenshots as files, and what is said of them.

use super::board::Picture;
use super::painter::PixelSource;
use super::session::{Session, Shot};
use crate::failure::Failure;
use crate::output::{in_line, print, print_json};
use brickfield_engine::picture::write_png;
use serde_json::json;
use std::path::{Path, PathBuf};

/// How much is said of a screenshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScreenshotMessages {
    Nothing,
    Text,
    Json,
}

/// Writes screenshots.
pub struct Screenshots {
    /// What names of the program's own choice begin with.
    pub stem: String,
    /// Of each style, whether nothing is seen through its pictures.
    pub opaque: Vec<bool>,
    /// Options of `render` beside those of the session, with a space before each.
    pub options: String,
    /// Those by which it draws on the device that may paint.
    pub device: String,
    pub saying: ScreenshotMessages,
}

impl Screenshots {
    /// A file's name that is free.
    pub fn name(&self) -> PathBuf {
        let name = |number: u32| PathBuf::from(format!("{}-{number:04}.png", self.stem));
        (1..).map(name).find(|path| !path.exists()).unwrap_or_else(|| name(0))
    }

    /// Writes the complete picture of a shot, and says by which options `render` draws the same.
    ///
    /// # Errors
    /// What writing gives.
    pub fn write(
        &self,
        path: &Path,
        session: &Session,
        shot: &Shot,
        picture: &Picture,
    ) -> Result<(), Failure> {
        let (size, opaque) = (picture.size, self.opaque[shot.style]);
        let mut rows = picture.pixels.chunks_exact(size[0] as usize);
        write_png(path, size, opaque, |file| rows.try_for_each(|row| file.row(row)))?;
        let backend = match picture.by {
            PixelSource::Processor => " --backend cpu",
            PixelSource::Device => &self.device,
        };
        let options = session.options(shot) + &self.options + backend;
        let name = in_line(path);
        match self.saying {
            ScreenshotMessages::Nothing => Ok(()),
            ScreenshotMessages::Json => {
                print_json(&json!({ "output": name, "size": size, "render": options }))
            }
            ScreenshotMessages::Text => {
                print(&format!("{name}: {} × {} pixels, as render {options}", size[0], size[1]))
            }
        }
    }
}
