//! The window of `brickfield view`.
//!
//! | file | owns |
//! |---|---|
//! | `session` | what the user looks at: events in, what is to be drawn out |
//! | `painter` | pictures of a store that get better; the processor's |
//! | `vulkan` | those of a device |
//! | `board` | the painter's thread, and its rows put together for the window |
//! | `overlay` | slider, status line and keys over the picture |
//! | `script` | scripts: a command a line |
//! | `screenshots` | screenshots as files |
//! | `window` | the window itself: the only file that knows it |

mod board;
mod overlay;
mod painter;
mod screenshots;
mod script;
mod session;
mod vulkan;
mod window;

pub use painter::{Appearance, CpuPainter, Painter};
pub use screenshots::{ScreenshotLook, ScreenshotMessages, Screenshots, screenshot_name};
pub use script::{ScriptLine, ScriptStep, place, read as read_script};
pub use session::{Session, ViewedStore};
pub use vulkan::VulkanPainter;
pub use window::Window;
