//! `brickfield completions` and `brickfield man`.

use crate::support::*;

#[test]
fn every_shell_has_completions() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = run(&[&"completions", &shell]).ok();
        assert!(script.contains("brickfield") && script.contains("winding"), "{shell}");
    }
}

#[test]
fn manual_pages_are_written() {
    let page = run(&[&"man"]).ok();
    assert!(page.contains(".TH brickfield 1") && page.contains(".SH NAME"), "{page}");
    let page = run(&[&"man", &"build"]).ok();
    assert!(page.contains(".TH brickfield-build 1") && page.contains("refine"), "{page}");
    let page = run(&[&"man", &"cache", &"merge"]).ok();
    assert!(page.contains(".TH brickfield-cache-merge 1") && page.contains("shards"), "{page}");
}
