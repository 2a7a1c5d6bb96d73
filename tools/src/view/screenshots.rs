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

/// What a style makes of screenshots.
#[derive(Clone, Debug)]
pub struct ScreenshotLook {
    /// Whether nothing is seen through its pictures.
    pub opaque: bool,
    /// Options of `render` that belong to it, with a space before each.
    pub options: String,
}

/// Writes screenshots.
pub struct Screenshots {
    /// What names of the program's own choice begin with.
    pub stem: String,
    /// By style.
    pub looks: Vec<ScreenshotLook>,
    /// Options of `render` beside those of the session, with a space before each.
    pub options: String,
    /// Those by which it draws on the device that may paint.
    pub device: String,
    pub saying: ScreenshotMessages,
}

/// The name of the program's own choice with a number.
pub fn screenshot_name(stem: &str, number: u32) -> PathBuf {
    PathBuf::from(format!("{stem}-{number:04}.png"))
}

impl Screenshots {
    /// A file's name that is free.
    pub fn name(&self) -> PathBuf {
        let free = (1..).map(|number| screenshot_name(&self.stem, number)).find(|path| !path.exists());
        free.unwrap_or_else(|| screenshot_name(&self.stem, 0))
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
        let (size, look) = (picture.size, &self.looks[shot.style]);
        let mut rows = picture.pixels.chunks_exact(size[0] as usize);
        write_png(path, size, look.opaque, |file| rows.try_for_each(|row| file.row(row)))?;
        let backend = match picture.by {
            PixelSource::Processor => " --backend cpu",
            PixelSource::Device => &self.device,
        };
        let options = session.options(shot) + &look.options + &self.options + backend;
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
